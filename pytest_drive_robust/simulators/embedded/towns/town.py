"""The `Town` that every style draws, and the types of its parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers, Range
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import Pose, moved


@dataclass(frozen=True, slots=True)
class DrawnLane:
    """A lane whose `centre` is (n, 3): x, y in metres and heading in radians, points at equal steps of about a metre.

    `lines` are `"none"`, `"striped"` or `"solid"`, left and right; `junction` is the number of the junction to which
    the lane belongs, or -1.
    """

    centre: Floats
    length_m: float
    width_m: float
    lines: tuple[str, str]
    speed_mps: float
    kind: LaneKind = LaneKind.DRIVING
    junction: int = -1


@dataclass(frozen=True, slots=True)
class Section:
    """The cross-section of a road, seen in its direction: lanes per way, widths, speed limit, sidewalk and parking.

    `biking_m` is the width of a biking lane to the right of the driving lanes, 0 for none; `left_walk` puts a sidewalk
    to the left of a one-way street, `left_parking` a parking lane between it and the driving lanes.
    """

    forward: int
    backward: int
    width_m: float
    speed_mps: float
    parking: bool = False
    sidewalk: bool = True
    left_walk: bool = False
    biking_m: float = 0.0
    left_parking: bool = False


@dataclass(frozen=True, slots=True)
class Arm:
    """A road seen from a junction: heading away from the centre, and distance of the box's edge from the centre.

    `ends_here`: the road was drawn towards the junction, so its forward lanes come in.
    """

    name: str
    heading_rad: float
    box_m: float
    section: Section
    centre: tuple[float, float] = (0.0, 0.0)
    ends_here: bool = False

    def edge(self) -> Pose:
        """Return where the road meets the box, heading away."""
        return moved((*self.centre, self.heading_rad), self.box_m)

    def inward(self, lane: str) -> str:
        """Return the chain of lane `"0"`, `"1"`, `"bike"`, ... that comes in."""
        return f"{self.name}.{'f' if self.ends_here else 'b'}{lane}"

    def outward(self, lane: str) -> str:
        """Return the chain of lane `"0"`, `"1"`, `"bike"`, ... that leads away."""
        return f"{self.name}.{'b' if self.ends_here else 'f'}{lane}"


@dataclass(frozen=True, slots=True)
class JunctionControl:
    """A light or a stop sign at the end of a lane: `what` is `"light"` or `"stop"`.

    A light stands `far_m` metres beyond the end of the lane, on the far side of the junction, `aside_m` off the kerb.
    """

    lane: int
    what: str
    far_m: float
    aside_m: float


@dataclass(slots=True)
class Town:
    """A town that a style draws: lanes, and the parts that refer to lanes by number.

    `slices` are cross-sections: lanes side by side from left to right, each with whether it leads along the road.
    `anchors` give by chain without a junction the metres along the chain to the style's feature. `crosswalks` are 4 x 2
    corners in metres. Buildings stand `building_gap_m` (least, most) from the sidewalks, or from the lanes of a town
    without sidewalks.
    """

    name: str
    lanes: list[DrawnLane] = field(default_factory=list)
    slices: list[tuple[tuple[int, bool], ...]] = field(default_factory=list)
    controls: list[JunctionControl] = field(default_factory=list)
    crosswalks: list[Floats] = field(default_factory=list)
    chains: dict[str, list[int]] = field(default_factory=dict)
    anchors: dict[str, float] = field(default_factory=dict)
    building_gap_m: Range = (2.0, 9.0)

    def add(self, lane: DrawnLane) -> int:
        """Add a lane and return its number."""
        self.lanes.append(lane)
        return len(self.lanes) - 1

    def new_junction(self) -> int:
        """Return an unused junction number."""
        return 1 + max((lane.junction for lane in self.lanes), default=-1)


Draw = Callable[[Town, RandomNumbers], None]
"""A style: a function that draws a town."""
