"""The driving policy under test, as a Protocol: users inherit from nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan

__all__ = ["SIGNALS", "Agent", "PlannedPath", "consumed_signals", "is_privileged"]

SIGNALS = ("cameras", "gps", "compass", "imu", "speed")
"""Every signal that an agent can declare in `consumes`."""


@runtime_checkable
class Agent(Protocol):
    """A driving policy.

    Some optional attributes are read when they exist:

    * `plan() -> PlannedPath`: the waypoints behind the last control, for overlays;
    * `consumes: frozenset[str]`: which of `SIGNALS` reach the policy (all of them when not said);
    * `privileged: bool`: True asks for `Observation.truth`; the report says so;
    * `weights: Sequence[str | Path]`, of the class or factory: files whose content belongs to the agent's fingerprint.

    One agent object drives many episodes, one after the other: `reset` must forget everything about the last one.
    """

    def sensors(self) -> Sequence[CameraSpec]:
        """The cameras of the rig, each with its own name. GPS, compass, IMU and speed are always there."""
        ...

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """A new episode begins. `seed` is the only allowed source of randomness."""
        ...

    def act(self, observation: Observation) -> Control:
        """The control for this tick. The observation belongs to the agent: it may be kept or written to."""
        ...


@dataclass(frozen=True, slots=True)
class PlannedPath:
    """What the agent means to do, for overlays: points in metres, ego frame (forward, right)."""

    path: tuple[tuple[float, float], ...] = ()
    target_points: tuple[tuple[float, float], ...] = ()
    speed_points: tuple[tuple[float, float], ...] = ()


def is_privileged(agent: Agent) -> bool:
    """True when the agent asks for ground truth."""
    return bool(getattr(agent, "privileged", False))


def consumed_signals(agent: Agent) -> frozenset[str]:
    """The signals that reach the policy: `consumes`, or all of `SIGNALS` when the agent does not say."""
    return frozenset(getattr(agent, "consumes", SIGNALS))
