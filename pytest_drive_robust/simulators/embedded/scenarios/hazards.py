"""The road leaves less room or less grip than it seems: bicycles, a door, invading traffic, dirt.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{route_obstacles,vehicle_opens_door,invading_turn,
control_loss}.py`.
"""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.arithmetic import arrays
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.actors import SIZES, ActorSpec, Arrival, Passing, Script
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths
from pytest_drive_robust.simulators.embedded.scenarios import parts
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

_BICYCLE_SHIFT = 0.55
"""How far to the right the bicycles ride, in halves of the lane."""
_DIRT_M = (14.0, 48.0, 74.0)
_PARKED_IN_LANE_M = 0.35
_CONE_STEP_M = 6.0
_HALF_A_CAR_M = 0.7
"""Half the width of a car, which Bench2Drive assumes for every car (`invading_turn.py`)."""


@scenario(
    "HazardAtSideLane",
    parameters={
        "distance": (41.0, 45.0),
        "speed": (45.0, 60.0),
        "bicycle_speed": (6.0, 12.0),
        "bicycle_drive_distance": (40.0, 101.0),
    },
    blocked_test_off=True,
)
def hazard_at_side_lane(stage: Stage) -> None:
    """Two slow bicycles at the edge of the lane; the lane to the left is in use."""
    parts.side_traffic(stage, 50.0)
    stage.end_m = stage.trigger_m + _bicycles(stage) + 10.0


@scenario(
    "HazardAtSideLaneTwoWays",
    parameters={"distance": (41.0, 45.0), "bicycle_speed": (6.0, 12.0), "bicycle_drive_distance": (40.0, 80.0)},
    intervals={"frequency": (75.0, 100.0)},
    blocked_test_off=True,
    two_ways=c.TWO_WAYS_TO_THE_END,
)
def hazard_at_side_lane_two_ways(stage: Stage) -> None:
    """Two slow bicycles at the edge of the lane; cars come the other way, in a lane that stays allowed."""
    parts.oncoming_gaps(stage)
    stage.borrow_lane(parts.ahead(stage, 43.0), near_m=50.0)
    stage.end_m = stage.trigger_m + _bicycles(stage) + 10.0


@scenario(
    "VehicleOpensDoorTwoWays",
    parameters={"distance": (37.0, 59.0)},
    intervals={"frequency": (30.0, 98.0)},
    blocked_test_off=True,
    two_ways=c.TWO_WAYS_WHILE_IT_RUNS,
)
def vehicle_opens_door_two_ways(stage: Stage) -> None:
    """A parked car opens its door when the ego is 3 s or 10 m away; cars come the other way."""
    at = parts.ahead(stage, 48.0, at_least_m=25.0)
    left_side = stage.lane_width_m / 2.0 - _PARKED_IN_LANE_M
    stage.stand(ActorKind.CAR, at, left_side + SIZES[ActorKind.CAR].width_m / 2.0)
    hinge_m = left_side - SIZES[ActorKind.DOOR].width_m / 2.0
    door = stage.stand(ActorKind.DOOR, at + 0.3, hinge_m, appears=True)
    stage.cast.script(door, Arrival(3.0, 10.0), Script(0.0, right_m=hinge_m), at=stage.spot(at + 0.3))
    parts.oncoming_gaps(stage)
    stage.borrow_lane(at, near_m=10.0, near_s=3.0)
    stage.end_m = stage.trigger_m + at + 50.0


@scenario("InvadingTurn", parameters={"distance": (75.0, 85.0), "offset": (0.18, 0.34)}, blocked_test_off=True)
def invading_turn(stage: Stage) -> None:
    """In a bend, cones push the oncoming cars over the centre line by about `offset`: keep to the right."""
    far = parts.ahead(stage, 80.0, at_least_m=45.0)
    over = min(max(stage.spec.number("offset", 0.25), -0.5), 0.5)
    path = _pushed_aside(stage, far, over + stage.lane_width_m / 2.0 - _HALF_A_CAR_M)
    stage.flow(
        path, speed_mps=0.7 * stage.speed_limit_mps, gap_m=(36.0, 44.0), background=True, sees=c.SEES_NOBODY,
    )  # fmt: skip
    for k in range(int((far - 25.0) / _CONE_STEP_M) + 1):
        stage.stand(ActorKind.CONE, 22.0 + _CONE_STEP_M * k, -1.4 * stage.lane_width_m)
    stage.end_m = stage.trigger_m + far + 10.0


@scenario("ControlLoss")
def control_loss(stage: Stage) -> None:
    """Dirt on the road at 14, 48 and 74 m disturbs throttle and steering."""
    for at in _DIRT_M:
        stage.dirt(at)
    parts.scenery(stage)
    stage.end_m = stage.trigger_m + _DIRT_M[-1] + 10.0


def _bicycles(stage: Stage) -> float:
    """Put two bicycles 9 m apart on the road; return the metres from the trigger to the stop of the last bicycle."""
    at = parts.ahead(stage, 43.0)
    ride = parts.speed(stage, "bicycle_speed", 9.0, at_least_kmh=2.0)
    drive = max(stage.spec.number("bicycle_drive_distance", 60.0), 5.0)
    edge = parts.right_hand(stage) * _BICYCLE_SHIFT * stage.lane_width_m / 2.0
    for k in range(2):
        start = stage.on_ego_path(at + 9.0 * k)
        bicycle = stage.cast.add(ActorSpec(ActorKind.BICYCLE, stage.ego_path, start, right_m=edge, end_m=start + drive))
        stage.cast.script(bicycle, Passing(0.0), Script(ride, right_m=edge))  # when the scenario begins
    return at + 9.0 + drive


def _pushed_aside(stage: Stage, far_m: float, aside_m: float) -> int:
    """Return the oncoming lane, shifted to its left by `aside_m` between `far_m` and 20 m after the trigger."""
    lane = stage.oncoming()
    line = stage.paths[lane]
    s = arc_lengths(line)
    begins, ends = stage.along(lane, far_m), stage.along(lane, 20.0)
    shift = aside_m * (_smooth((s - begins) / 20.0 + 1.0) - _smooth((s - ends) / 12.0))
    left = np.column_stack([arrays.sin(line[:, 2]), -arrays.cos(line[:, 2])])
    return stage.add_path(line[:, :2] + shift[:, None] * left)


def _smooth(share: Floats) -> Floats:
    """Return 0 below 0, 1 above 1, without a kink in between."""
    t = np.clip(share, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
