"""Something stands or crawls in the ego's lane: pass it."""

from __future__ import annotations

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.scenarios.base import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = ["hazard_at_side_lane_two_ways", "parked_obstacle"]

_KMH = 1.0 / 3.6


@scenario(
    "ParkedObstacle",
    sites=(Site("Avenue", "road.f1", (125.0, 150.0)),),
    parameters={"distance": (40.0, 43.0), "speed": (40.0, 59.0)},
    blocked_test_off=True,
)
def parked_obstacle(stage: Stage) -> None:
    """A badly parked car, shifted to the right by 0.7 of half a lane; the lane to the left is in use."""
    distance = stage.spec.number("distance", 41.0)
    speed = stage.spec.number("speed", 50.0) * _KMH
    shift = 0.7 * (stage.lane_width_m / 2.0)
    stage.stand(ActorKind.CAR, distance, shift)
    stage.flow(stage.beside("left"), speed_mps=speed, gap_m=(35.0, 70.0), background=True)
    stage.flow(stage.oncoming(), speed_mps=speed, gap_m=(40.0, 90.0), background=True)
    stage.end_m = stage.trigger_m + distance + 30.0


@scenario(
    "HazardAtSideLaneTwoWays",
    sites=(Site("Street", "road.f0", (125.0, 150.0)),),
    parameters={"distance": (41.0, 45.0), "bicycle_speed": (6.0, 12.0), "bicycle_drive_distance": (40.0, 80.0)},
    intervals={"frequency": (75.0, 100.0)},
    blocked_test_off=True,
    two_ways=True,
)
def hazard_at_side_lane_two_ways(stage: Stage) -> None:
    """Two slow bicycles nine metres apart at the edge of the lane; cars come the other way."""
    distance = stage.spec.number("distance", 43.0)
    speed = stage.spec.number("bicycle_speed", 9.0) * _KMH
    drive = stage.spec.number("bicycle_drive_distance", 60.0)
    edge = stage.lane_width_m / 2.0 - 0.45
    for k in range(2):
        start = stage.on_ego_path(distance + 9.0 * k)
        bicycle = stage.drive(
            ActorKind.BICYCLE, stage.ego_path, start, 0.0, target_mps=speed, right_m=edge, end_m=start + drive,
            at_end=c.AT_END_LEAVE,
        )  # fmt: skip
        stage.cast.script(bicycle, stage.passing(0.0), stage.ride(speed, edge))
    gaps = (
        stage.spec.number("frequency", 75.0, attribute="from"),
        stage.spec.number("frequency", 100.0, attribute="to"),
    )
    stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=gaps, background=True)
    stage.end_m = stage.trigger_m + distance + drive + 20.0
