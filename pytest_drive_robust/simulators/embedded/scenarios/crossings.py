"""Somebody walks into the road: stop in time."""

from __future__ import annotations

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded.scenarios.base import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.triggers import Arrival

__all__ = ["dynamic_object_crossing", "pedestrian_crossing"]


@scenario(
    "DynamicObjectCrossing",
    sites=(Site("Street", "road.f0", (120.0, 145.0)),),
    parameters={"distance": (40.0, 50.0)},
)
def dynamic_object_crossing(stage: Stage) -> None:
    """A pedestrian at 2 m/s from behind a container; starts when the ego is 2.1 s or 6 m away."""
    distance = stage.spec.number("distance", 45.0)
    edge = stage.lane_width_m / 2.0
    stage.stand(ActorKind.CONTAINER, distance - 2.2, edge + 1.2)
    stage.walker(
        distance,
        from_right_m=edge + 1.6,
        walks_m=2.0 * stage.lane_width_m + 3.0,
        speed_mps=2.0,
        trigger=Arrival(2.1, 6.0),
    )
    stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=(45.0, 90.0), background=True)
    stage.end_m = stage.trigger_m + distance + 20.0


@scenario(
    "PedestrianCrossing",
    sites=(
        Site("LightCrossing", "E.straight0", (75.0, 90.0), trigger_m=(4.0, 10.0), before_m=(38.0, 46.0)),
        Site("OpenCrossing", "S.right0", (70.0, 85.0), trigger_m=(4.0, 10.0), before_m=(38.0, 46.0)),
    ),
)
def pedestrian_crossing(stage: Stage) -> None:
    """Three pedestrians cross at the junction's entry, 1.3 to 2.0 m/s; they start at 3.5 s or 12 m."""
    crosswalk = stage.junction_ahead_m() - 2.1
    for k in range(3):
        stage.walker(
            crosswalk + 0.8 * (k - 1),
            from_right_m=stage.lane_width_m / 2.0 + 1.5 + 0.7 * k,
            walks_m=2.0 * stage.lane_width_m + 4.0 + 0.7 * k,
            speed_mps=stage.draw(f"walker speed {k}", 1.3, 2.0),
            delay_s=stage.draw(f"walker idle {k}", 0.0, 1.5),
            trigger=Arrival(3.5, 12.0),
        )
    stage.green_for_ego()
    stage.flow(stage.oncoming(), speed_mps=0.6 * stage.speed_limit_mps, gap_m=(60.0, 120.0), background=True)
    stage.end_m = stage.trigger_m + crosswalk + 20.0
