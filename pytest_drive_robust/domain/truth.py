"""The state of the world as a simulator knows it: for scoring, for drawing, and for privileged agents only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum, IntFlag
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class ActorKind(IntEnum):
    """The kind of an actor, which decides its looks and the class of a collision with it."""

    CAR = 0
    VAN = 1
    TRUCK = 2
    EMERGENCY = 3
    BICYCLE = 4
    PEDESTRIAN = 5
    CONE = 6
    BARRIER = 7
    CONTAINER = 8
    WARNING_SIGN = 9
    BUILDING = 10
    DOOR = 11
    DIRT = 12

    @property
    def collision_class(self) -> str:
        """`"vehicle"`, `"pedestrian"` or `"layout"`: the three classes of the leaderboard's collision test."""
        if self is ActorKind.PEDESTRIAN:
            return "pedestrian"
        return "vehicle" if self <= ActorKind.BICYCLE else "layout"


class ActorState(IntFlag):
    """The lights and the siren that an actor shows."""

    NONE = 0
    BRAKING = 1
    INDICATOR_LEFT = 2
    INDICATOR_RIGHT = 4
    SIREN = 8


class LightState(IntEnum):
    """What a stop line demands at this moment."""

    GREEN = 0
    YELLOW = 1
    RED = 2
    STOP_SIGN = 3


class LaneKind(IntEnum):
    """What a lane is for."""

    DRIVING = 0
    PARKING = 1
    SIDEWALK = 2
    BIKING = 3


@dataclass(frozen=True, slots=True)
class Lane:
    """One lane, sampled about every metre.

    `centre` is (n, 3): x, y in metres and heading in radians. `left` and `right` are the indices of the neighbour
    lanes or -1; `*_same_way` tells whether the neighbour leads the same way. `left_line`, `right_line` are `"none"`,
    `"striped"` or `"solid"`.
    """

    index: int
    kind: LaneKind
    centre: Floats
    width_m: float
    speed_limit_mps: float
    junction: bool
    left: int
    right: int
    left_same_way: bool
    right_same_way: bool
    left_line: str
    right_line: str
    successors: tuple[int, ...]

    def beside(self, side: str) -> tuple[int, bool]:
        """Return the neighbour to the `"left"` or `"right"`, or -1, and whether it leads the same way."""
        return (self.left, self.left_same_way) if side == "left" else (self.right, self.right_same_way)


@dataclass(frozen=True, slots=True)
class StopLine:
    """Where a light or a stop sign makes traffic wait.

    (`x_m`, `y_m`) is the centre of the line on its lane, `heading_rad` the heading of traffic that it stops,
    `width_m` the width of the lane; (`pole_x_m`, `pole_y_m`) is where the light or sign stands, facing that traffic.
    """

    index: int
    lane: int
    x_m: float
    y_m: float
    heading_rad: float
    width_m: float
    is_light: bool
    pole_x_m: float
    pole_y_m: float


@dataclass(frozen=True, slots=True)
class LaneMap:
    """The static world of a route.

    `crosswalks` is (c, 4, 2): the corners of each crossing in metres. `buildings` is (b, 6): x, y, yaw, length, width,
    height. `name` is the town.
    """

    name: str
    lanes: tuple[Lane, ...]
    stop_lines: tuple[StopLine, ...]
    crosswalks: Floats
    buildings: Floats


@dataclass(frozen=True, slots=True)
class EgoState:
    """The ego at the end of a tick: centre of the vehicle in metres, yaw in radians, speeds in SI units."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    forward_mps2: float
    right_mps2: float
    yaw_rate_radps: float
    length_m: float
    width_m: float


@dataclass(frozen=True, slots=True)
class WorldState:
    """The dynamic world at the end of a tick.

    `actors` is (k, COLUMNS) float64, one row for each actor that exists now, columns (named by the constants):
    id, kind (`ActorKind`), x, y, yaw, speed, length, width, height, state (`ActorState`).
    `lights` is (number of stop lines,) int: a `LightState` each.
    """

    tick: int
    ego: EgoState
    actors: Floats
    lights: NDArray[np.int64]

    ID, KIND, X, Y, YAW, SPEED, LENGTH, WIDTH, HEIGHT, STATE = range(10)
    COLUMNS = 10


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """What a privileged agent may see.

    `route` is (n, 4): x, y, yaw and the speed limit in m/s, one row about every metre; `progress` is the row that the
    ego has reached.
    """

    state: WorldState
    lane_map: LaneMap
    route: Floats
    progress: int

    def private(self) -> GroundTruth:
        """Return the truth of this moment in arrays of its own. The lane map is static and stays shared."""
        state = replace(self.state, actors=self.state.actors.copy(), lights=self.state.lights.copy())
        return replace(self, state=state, route=self.route.copy())
