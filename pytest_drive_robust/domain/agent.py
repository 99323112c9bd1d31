"""The driving policy under test, as a Protocol: users inherit from nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.errors import UsageError

SIGNALS = ("cameras", "gps", "compass", "imu", "speed")
"""Every signal that an agent can declare in `consumes`."""


@runtime_checkable
class Agent(Protocol):
    """A driving policy.

    Some optional attributes are read when they exist:

    * `plan() -> PlannedPath`: the waypoints behind the last control, for overlays;
    * `consumes: frozenset[str]`: which of `SIGNALS` reach the policy (all of them when not said);
    * `privileged: bool`: True asks for `Observation.truth`; the report says so;
    * `portable_bits: bool`, of the class or factory: True promises that the controls depend only on the observations
      and the agent's own code, to the last bit, whatever the processor and the versions of libraries: no network, no
      matrix product, no elementary function but those of `pytest_drive_robust.arithmetic`, no draws by a library. The
      agent's episodes have the same bits everywhere, and the versions of imported libraries are not in their keys
      (default: False);
    * `computed_by: Sequence[str]`, of the class or factory: where bits are not portable, the modules that decide the
      controls beside the agent's own code, such as `("torch", "numpy")`. The versions of these modules are in the keys
      of the episodes, and records tell what the modules compute on this processor (default: all that the agent's code
      imports);
    * `weights: Sequence[str | Path]`, of the class or factory: files and folders whose content belongs to the agent's
      fingerprint and to the keys of its episodes. Files that options in the agent's name give belong there as well;
    * `configuration`, of the class or factory: plain values (numbers, text, lists, mappings, dataclasses) that decide
      how the agent drives and are not in its source, such as values read from the environment;
    * `check(**options)`, of the factory (of a class: a `classmethod`): called at collection with the options in the
      agent's name that `check` takes; raises `UsageError` when no agent can be made;
    * `num_cpus` and `num_gpus`, of the class or factory: what an episode needs on a cluster (default: 1 and 0);
    * `act_batch(agents: Sequence[Self], observations: Sequence[Observation]) -> Sequence[Control]`, a `staticmethod` or
      `classmethod`: `act` for many agent objects at once, each in an episode of its own. `--drive-lockstep` uses
      `act_batch` when the factory is the class or is annotated to return the class. The state of an episode belongs to
      its agent object; only weights are shared. A call has 4, 8, 16 and so on agents, or as many as the option says. A
      control must depend only on its own agent and observation, to the last bit: the runner checks this first and
      refuses an agent that fails. An exception that is returned in place of a control is the fault of that episode
      alone; an exception that is raised makes the other episodes start again.

    One agent object drives many episodes, one after the other: `reset` must forget everything about the last one.
    """

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the cameras of the rig, each with its own name. GPS, compass, IMU and speed are always there."""

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Begin a new episode. `seed` is the only allowed source of randomness."""

    def act(self, observation: Observation) -> Control:
        """Return the control for this tick. The observation belongs to the agent: it may be kept or written to."""


@dataclass(frozen=True, slots=True)
class PlannedPath:
    """The way that the agent plans to drive, for overlays: points in metres, ego frame (forward, right)."""

    path: tuple[tuple[float, float], ...] = ()
    target_points: tuple[tuple[float, float], ...] = ()
    speed_points: tuple[tuple[float, float], ...] = ()


def is_privileged(agent: Agent) -> bool:
    """Return True when the agent asks for ground truth."""
    return bool(getattr(agent, "privileged", False))


def has_portable_bits(agent: object) -> bool:
    """Return True when an agent, its factory or a simulator promises the same bits on every machine."""
    return getattr(agent, "portable_bits", False) is True


def computing_modules(agent: object) -> tuple[str, ...] | None:
    """Return the modules that decide an agent's bits beside its own code, or None when `computed_by` is missing.

    `agent` is an agent or its factory. The result is empty where bits are portable. Raises `UsageError` when
    `computed_by` holds anything but names.
    """
    if has_portable_bits(agent):
        return ()
    named = getattr(agent, "computed_by", None)
    if named is None:
        return None
    modules = tuple(named) if isinstance(named, (list, tuple)) else (named,)
    if not all(isinstance(module, str) for module in modules):
        raise UsageError(f"`computed_by` of an agent is {named!r}, expected names of modules, as in ('onnxruntime',).")
    return modules


def consumed_signals(agent: Agent) -> frozenset[str]:
    """Return the signals that reach the policy: `consumes`, or all of `SIGNALS` when the agent does not say."""
    return frozenset(getattr(agent, "consumes", SIGNALS))


def offers_lockstep(agent: object) -> bool:
    """Return True when the agent has an `act_batch`, without a check of what `act_batch` returns."""
    return callable(getattr(agent, "act_batch", None))
