"""Something stands in the ego's lane: change lanes, or borrow the oncoming one.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{route_obstacles,construction_crash_vehicle}.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from pytest_drive_robust.arithmetic.random_numbers import Range
from pytest_drive_robust.domain.truth import ActorKind, ActorState
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.scenarios.parts import ahead, oncoming_gaps, right_hand, side_traffic
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

_ACCIDENT_SHIFT, _PARKED_SHIFT = 0.6, 0.7
"""How far to the right the crashed and the parked cars stand, in halves of the lane."""
_PASSED_M = 50.0
"""Distance from the last vehicle, or the beginning of the building site, to the end of the scenario."""


def _crashed_cars(stage: Stage) -> tuple[float, float]:
    """Put a police car and crashed cars 10 and 16 m behind it; return metres from the trigger, see `_obstacle`."""
    at = ahead(stage, 42.0)
    shift = right_hand(stage) * _ACCIDENT_SHIFT * stage.lane_width_m / 2.0
    stage.stand(ActorKind.EMERGENCY, at, shift)
    for k, further in enumerate((10.0, 16.0)):
        stage.stand(ActorKind.CAR, at + further, shift, yaw_rad=stage.draw(f"crashed {k}", -0.3, 0.3))
    return at + 10.0, at + 16.0


def _building_site(stage: Stage) -> tuple[float, float]:
    """Put a sign, 3 cones across the lane, a barrier, 4 cones along its left edge; return metres, see `_obstacle`."""
    at = ahead(stage, 42.0)
    half, side = stage.lane_width_m / 2.0, right_hand(stage)
    stage.stand(ActorKind.WARNING_SIGN, at - 5.0)
    for k in range(3):
        stage.stand(ActorKind.CONE, at, side * (half - 0.5 - k))
    stage.stand(ActorKind.BARRIER, at + 2.0, yaw_rad=math.pi / 2.0)
    for k in range(4):
        stage.stand(ActorKind.CONE, at + 2.0 * k, side * (0.4 - half))
    return at, at


def _badly_parked_car(stage: Stage) -> tuple[float, float]:
    """Put a badly parked car into the lane, hazard lights on; return metres from the trigger, see `_obstacle`."""
    at = ahead(stage, 41.0)
    right_m = right_hand(stage) * _PARKED_SHIFT * stage.lane_width_m / 2.0
    stage.stand(ActorKind.CAR, at, right_m, state=ActorState.INDICATOR_LEFT | ActorState.INDICATOR_RIGHT)
    return at, at


def _obstacle(
    name: str,
    put: Callable[[Stage], tuple[float, float]],
    *,
    distance_m: Range,
    side_kmh: float = 0.0,
    speed_kmh: Range | None = None,
    oncoming_m: Range | None = None,
    near_m: float = 50.0,
) -> None:
    """Register a type: something stands in the ego's lane, and somebody is in the way of driving around it.

    `put` places the obstacle and returns two distances in metres from the trigger: the place that the ego has to come
    near (by `near_m`), and the place from which the end of the scenario is measured. Traffic drives in the lane to the
    left, at `side_kmh` or at a speed drawn from `speed_kmh`. With `oncoming_m`, the way around is the oncoming lane
    instead, where cars come with gaps of `oncoming_m`.
    """

    def build(stage: Stage) -> None:
        if oncoming_m is None:
            side_traffic(stage, side_kmh)
        else:
            oncoming_gaps(stage)
        first_m, last_m = put(stage)
        stage.borrow_lane(first_m, near_m=near_m)
        stage.end_m = stage.trigger_m + last_m + _PASSED_M

    scenario(
        name,
        parameters={"distance": distance_m} | ({} if speed_kmh is None else {"speed": speed_kmh}),
        intervals={} if oncoming_m is None else {"frequency": oncoming_m},
        blocked_test_off=True,
        two_ways=c.TWO_WAYS_NEVER if oncoming_m is None else c.TWO_WAYS_WHILE_IT_RUNS,
    )(build)


_obstacle("Accident", _crashed_cars, side_kmh=55.0, distance_m=(40.0, 44.0), speed_kmh=(53.0, 57.0))
_obstacle("AccidentTwoWays", _crashed_cars, oncoming_m=(32.0, 184.0), distance_m=(40.0, 44.0))
_obstacle("ConstructionObstacle", _building_site, side_kmh=50.0, distance_m=(40.0, 45.0), speed_kmh=(47.0, 55.0))
_obstacle("ConstructionObstacleTwoWays", _building_site, oncoming_m=(43.0, 200.0), distance_m=(40.0, 45.0), near_m=30.0)
_obstacle("ParkedObstacle", _badly_parked_car, side_kmh=50.0, distance_m=(40.0, 43.0), speed_kmh=(40.0, 59.0))
_obstacle("ParkedObstacleTwoWays", _badly_parked_car, oncoming_m=(31.0, 151.0), distance_m=(40.0, 43.0))
