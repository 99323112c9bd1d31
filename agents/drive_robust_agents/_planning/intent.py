"""The reasons of the expert's last control, for labels, commentary and overlays."""

from __future__ import annotations

from dataclasses import dataclass

from drive_robust_agents._planning.static_scene import StaticScene
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Intent"]


@dataclass(frozen=True, slots=True)
class Intent:
    """The line that the expert follows, and the reasons of its speed.

    `line` is (n, 5) x, y, yaw, cosine and sine of yaw, one row for each row of `scene.route`; the ego is at `row`. The
    front bumper must not pass row `rule_row` (a red light, a stop sign without a stop yet), nor row `stop_row` (the
    rule row, or where the ego waits to pass an obstacle or to change lanes); infinite where nothing is in the way.
    `passing`: the ego passes an obstacle or clears the way for a siren. `waiting`: the ego waits for a gap to leave a
    parking space, to change lanes or to pass an obstacle.
    """

    scene: StaticScene
    line: Floats
    row: float
    acceleration_mps2: float
    rule_row: float
    stop_row: float
    passing: bool
    waiting: bool
