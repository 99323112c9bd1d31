"""Something stands in the ego's lane: change lanes, or borrow the oncoming one.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{route_obstacles,construction_crash_vehicle}.py`.
"""

from __future__ import annotations

import math

from pytest_drive_robust.domain.truth import ActorKind, ActorState
from pytest_drive_robust.simulators.embedded.scenarios.base import Site, scenario
from pytest_drive_robust.simulators.embedded.scenarios.surroundings import (
    ahead,
    oncoming_gaps,
    right_hand,
    side_traffic,
)
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = [
    "accident",
    "accident_two_ways",
    "construction_obstacle",
    "construction_obstacle_two_ways",
    "parked_obstacle",
    "parked_obstacle_two_ways",
]

_ACCIDENT_SHIFT, _PARKED_SHIFT = 0.6, 0.7
"""How far to the right they stand, in halves of the lane."""
_PASSED_M = 20.0
"""The scenario is over so many metres behind the last thing."""


@scenario(
    "Accident",
    sites=(
        Site("Avenue", "road.f1", (115.0, 135.0)),
        Site("OneWayStreet", "road.f1", (115.0, 135.0)),
        Site("ParkingAvenue", "road.b1", (115.0, 135.0)),
    ),
    parameters={"distance": (40.0, 44.0), "speed": (53.0, 57.0)},
    blocked_test_off=True,
)
def accident(stage: Stage) -> None:
    """A police car and two crashed cars; the lane to the left is in use."""
    side_traffic(stage, 55.0)
    stage.end_m = stage.trigger_m + _crashed_cars(stage) + _PASSED_M


@scenario(
    "AccidentTwoWays",
    sites=(
        Site("Street", "road.f0", (112.0, 132.0)),
        Site("RuralRoad", "road.f0", (120.0, 140.0)),
        Site("ParkingStreet", "road.b0", (112.0, 132.0)),
    ),
    parameters={"distance": (40.0, 44.0)},
    intervals={"frequency": (32.0, 184.0)},
    blocked_test_off=True,
    two_ways=True,
)
def accident_two_ways(stage: Stage) -> None:
    """A police car and two crashed cars; the way around them is the oncoming lane."""
    oncoming_gaps(stage, (32.0, 184.0))
    stage.end_m = stage.trigger_m + _crashed_cars(stage) + _PASSED_M


@scenario(
    "ConstructionObstacle",
    sites=(
        Site("Avenue", "road.f1", (128.0, 145.0)),
        Site("Highway", "road.f2", (130.0, 150.0)),
        Site("OneWayStreet", "road.f1", (128.0, 145.0)),
    ),
    parameters={"distance": (40.0, 45.0), "speed": (47.0, 55.0)},
    blocked_test_off=True,
)
def construction_obstacle(stage: Stage) -> None:
    """A building site fills the lane; the lane to the left is in use."""
    side_traffic(stage, 50.0)
    stage.end_m = stage.trigger_m + _building_site(stage) + _PASSED_M


@scenario(
    "ConstructionObstacleTwoWays",
    sites=(
        Site("Street", "road.b0", (118.0, 136.0)),
        Site("ParkingStreet", "road.f0", (118.0, 136.0)),
        Site("RuralRoad", "road.b0", (125.0, 145.0)),
    ),
    parameters={"distance": (40.0, 45.0)},
    intervals={"frequency": (43.0, 200.0)},
    blocked_test_off=True,
    two_ways=True,
)
def construction_obstacle_two_ways(stage: Stage) -> None:
    """A building site fills the lane; the way around it is the oncoming lane."""
    oncoming_gaps(stage, (43.0, 200.0))
    stage.end_m = stage.trigger_m + _building_site(stage) + _PASSED_M


@scenario(
    "ParkedObstacle",
    sites=(
        Site("Avenue", "road.f1", (125.0, 145.0)),
        Site("OneWayStreet", "road.f1", (125.0, 145.0)),
        Site("ParkingAvenue", "road.f1", (125.0, 145.0)),
    ),
    parameters={"distance": (40.0, 43.0), "speed": (40.0, 59.0)},
    blocked_test_off=True,
)
def parked_obstacle(stage: Stage) -> None:
    """A badly parked car with its hazard lights on; the lane to the left is in use."""
    side_traffic(stage, 50.0)
    stage.end_m = stage.trigger_m + _badly_parked_car(stage) + _PASSED_M


@scenario(
    "ParkedObstacleTwoWays",
    sites=(
        Site("Street", "road.f0", (112.0, 132.0)),
        Site("ParkingStreet", "road.f0", (112.0, 132.0)),
        Site("RuralRoad", "road.f0", (120.0, 140.0)),
    ),
    parameters={"distance": (40.0, 43.0)},
    intervals={"frequency": (31.0, 151.0)},
    blocked_test_off=True,
    two_ways=True,
)
def parked_obstacle_two_ways(stage: Stage) -> None:
    """A badly parked car with its hazard lights on; the way around it is the oncoming lane."""
    oncoming_gaps(stage, (31.0, 151.0))
    stage.end_m = stage.trigger_m + _badly_parked_car(stage) + _PASSED_M


def _crashed_cars(stage: Stage) -> float:
    """A police car, crashed cars 10 and 16 m behind it; metres from the trigger to the last one."""
    at = ahead(stage, 42.0)
    shift = right_hand(stage) * _ACCIDENT_SHIFT * stage.lane_width_m / 2.0
    stage.stand(ActorKind.EMERGENCY, at, shift)
    for k, further in enumerate((10.0, 16.0)):
        stage.stand(ActorKind.CAR, at + further, shift, yaw_rad=stage.draw(f"crashed {k}", -0.3, 0.3))
    return at + 16.0


def _building_site(stage: Stage) -> float:
    """Sign, three cones across the lane, debris, four cones along its left edge; metres to the last one."""
    at = ahead(stage, 42.0)
    half, side = stage.lane_width_m / 2.0, right_hand(stage)
    stage.stand(ActorKind.WARNING_SIGN, at - 5.0)
    for k in range(3):
        stage.stand(ActorKind.CONE, at, side * (half - 0.5 - k))
    stage.stand(ActorKind.BARRIER, at + 2.0, yaw_rad=math.pi / 2.0)
    for k in range(4):
        stage.stand(ActorKind.CONE, at + 2.0 * k, side * (0.4 - half))
    return at + 6.0


def _badly_parked_car(stage: Stage) -> float:
    """A car that reaches into the lane; metres from the trigger to it."""
    at = ahead(stage, 41.0)
    right_m = right_hand(stage) * _PARKED_SHIFT * stage.lane_width_m / 2.0
    stage.stand(ActorKind.CAR, at, right_m, state=ActorState.INDICATOR_LEFT | ActorState.INDICATOR_RIGHT)
    return at
