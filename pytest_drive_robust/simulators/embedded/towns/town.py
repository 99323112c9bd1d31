"""What every style draws with: the `Town` and the words for its parts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.simulators.embedded.towns.road_library import AbstractLane, RoadNetwork

__all__ = ["Arm", "JunctionControl", "LaneKey", "Pose", "Section", "Town"]

LaneKey = tuple[str, str, int]
"""As in highway-env: (from node, to node, number)."""

Pose = tuple[float, float, float]
"""x and y in metres, heading in radians, clockwise (y points down, as in CARLA)."""


@dataclass(frozen=True, slots=True)
class Section:
    """The cross-section of a road, seen in its direction: lanes per way, widths, speed limit, what lies beside.

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
    """A road seen from a junction: heading away from the centre, distance of the box's edge from the centre.

    `ends_here` tells that the road was drawn towards the junction: its forward lanes come in.
    """

    name: str
    heading_rad: float
    box_m: float
    section: Section
    centre: tuple[float, float] = (0.0, 0.0)
    ends_here: bool = False

    def edge(self) -> Pose:
        """Return where the road meets the box, heading away."""
        x, y = self.centre
        return (
            x + self.box_m * scalars.cos(self.heading_rad),
            y + self.box_m * scalars.sin(self.heading_rad),
            self.heading_rad,
        )

    def inward(self, lane: str) -> str:
        """Return the chain of lane `"0"`, `"1"`, `"bike"`, ... that comes in."""
        return f"{self.name}.{'f' if self.ends_here else 'b'}{lane}"

    def outward(self, lane: str) -> str:
        """Return the chain of lane `"0"`, `"1"`, `"bike"`, ... that leads away."""
        return f"{self.name}.{'b' if self.ends_here else 'f'}{lane}"


@dataclass(frozen=True, slots=True)
class JunctionControl:
    """What stands at the end of a lane: `what` is `"light"` or `"stop"`.

    A light stands `far_m` metres beyond the end of the lane, on the far side of the junction, `aside_m` off the kerb.
    """

    lane: LaneKey
    what: str
    far_m: float
    aside_m: float


@dataclass(slots=True)
class Town:
    """What a style draws: highway-env's network plus what highway-env cannot say.

    `kinds` is keyed like highway-env's lanes; `junctions` tells the number of the junction to which a lane belongs.
    `slices` are cross-sections: lanes side by side from left to right, and whether each leads along the road. `anchors`
    are metres along a chain: where what the style is about begins, for chains without a junction. `crosswalks` are
    4 x 2 corners in metres. Buildings stand `building_gap_m` (least, most) from the sidewalks, or from the lanes where
    there is no sidewalk.
    """

    name: str
    network: RoadNetwork = field(default_factory=RoadNetwork)
    kinds: dict[LaneKey, LaneKind] = field(default_factory=dict)
    junctions: dict[LaneKey, int] = field(default_factory=dict)
    slices: list[tuple[tuple[LaneKey, bool], ...]] = field(default_factory=list)
    controls: list[JunctionControl] = field(default_factory=list)
    crosswalks: list[NDArray[np.float64]] = field(default_factory=list)
    chains: dict[str, list[LaneKey]] = field(default_factory=dict)
    anchors: dict[str, float] = field(default_factory=dict)
    building_gap_m: tuple[float, float] = (2.0, 9.0)

    def add(
        self,
        start: str,
        end: str,
        lane: AbstractLane,
        *,
        kind: LaneKind = LaneKind.DRIVING,
        junction: int | None = None,
    ) -> LaneKey:
        """Add a lane between two nodes and note its kind and its junction."""
        self.network.add_lane(start, end, lane)
        key = (start, end, len(self.network.graph[start][end]) - 1)
        self.kinds[key] = kind
        if junction is not None:
            self.junctions[key] = junction
        return key

    def new_junction(self) -> int:
        """Return a number that no junction has yet."""
        return 1 + max(self.junctions.values(), default=-1)
