"""What an agent was given in one episode, and how much of it differed from what its sensors captured."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CONTROL", "Reception", "Touch"]

CONTROL = "control"
"""The name of the command on its way from the agent to the vehicle, beside `SIGNALS` and the names of cameras."""


@dataclass(frozen=True, slots=True)
class Touch:
    """One signal that a setting changed: in how many ticks, and in which one first.

    `signal` is the name of a camera, `"gps"`, `"compass"`, `"imu"`, `"speed"`, or `"control"` when the vehicle got
    another command than the agent gave in that tick, or when the agent's computer was too busy to be asked.
    """

    signal: str
    ticks: int
    first_tick: int


@dataclass(frozen=True, slots=True)
class Reception:
    """Proof of what a setting did at the two seams of one episode.

    `cameras` are the names of the agent's rig, `consumes` the signals that reach its policy by its own word (all of
    them when it does not say), `observations` how many it was given. `touched` is empty when nothing was changed.
    """

    cameras: tuple[str, ...]
    consumes: tuple[str, ...]
    observations: int
    touched: tuple[Touch, ...] = ()
