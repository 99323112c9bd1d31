"""What is behind the last control of the expert: for labels, commentary and overlays."""

from __future__ import annotations

from dataclasses import dataclass

from drive_robust_agents._planning.static_scene import StaticScene
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Intent"]


@dataclass(frozen=True, slots=True)
class Intent:
    """The line that is followed, and why it is driven at that speed.

    `line` is (n, 5) x, y, yaw, cosine and sine of yaw, one row for each row of `scene.route`; the ego is at `row`. The
    front bumper must not pass row `rule_row` (a red light, a stop sign not yet honoured) nor row `stop_row` (that, or
    where the way around an obstacle or a lane change is waited for); both are infinite where nothing is in the way.
    `passing`: on the way around something, or out of the way of a siren; `waiting`: for a gap to leave a parking space,
    to change lanes or to pass something.
    """

    scene: StaticScene
    line: Floats
    row: float
    acceleration_mps2: float
    rule_row: float
    stop_row: float
    passing: bool
    waiting: bool
