"""Somebody walks or rides into the road: stop in time.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{object_crash_vehicle,pedestrian_crossing,
object_crash_intersection}.py`.
"""

from __future__ import annotations

import math

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded.actors import Arrival
from pytest_drive_robust.simulators.embedded.scenarios.parts import ahead, right_hand, road_edge_m, scenery
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

_LATER_S = 0.02
"""Delay per degree of a slanted crossing, to either side, because a slanted way is longer. In Bench2Drive, a degree
away from the ego shortens the time: its walkers meet the ego's path elsewhere, ours meet the path at the same place."""
_PARKED_M = (-4.0, -10.6, -17.2, 4.2, 10.8)
"""Places of the cars in a parked row, in metres from the gap where a pedestrian steps out."""


@scenario("DynamicObjectCrossing", parameters={"distance": (40.0, 50.0), "crossing_angle": (-8.0, 8.0)})
def dynamic_object_crossing(stage: Stage) -> None:
    """A pedestrian at 2 m/s from behind a container; starts when the ego is 2.1 s or 6 m away.

    Every 5 degrees of `crossing_angle` make it 0.1 s more.
    """
    at = ahead(stage, 45.0)
    # the pedestrian comes from the right edge of the lane, or from the left edge of the road
    edge = stage.lane_width_m / 2.0 if right_hand(stage) > 0.0 else road_edge_m(stage, "left", at)
    stage.stand(ActorKind.CONTAINER, at - 2.2, right_hand(stage) * (edge + 1.2))
    _steps_out(stage, at, edge + 1.6, beyond_m=1.5, tta_s=2.1)


@scenario("ParkingCrossingPedestrian", parameters={"distance": (36.0, 45.0)})
def parking_crossing_pedestrian(stage: Stage) -> None:
    """A pedestrian at 2 m/s from behind a parked van; starts when the ego is 2.15 s or 6 m away.

    They cross the whole road, where Bench2Drive's vanish after 8 m. Every 5 degrees of `crossing_angle` make it 0.1 s
    more.
    """
    at = ahead(stage, 40.0)
    kerb = stage.lane_width_m / 2.0 + 1.2
    for k, further in enumerate(_PARKED_M):
        stage.stand(ActorKind.CAR if k else ActorKind.VAN, at + further, right_hand(stage) * kerb)
    _steps_out(stage, at, kerb + 0.6, beyond_m=1.0, tta_s=2.15)


@scenario("PedestrianCrossing")
def pedestrian_crossing(stage: Stage) -> None:
    """Three pedestrians cross at the junction's entry, 1.3 to 2.0 m/s; they start at 3.5 s or 12 m."""
    crosswalk = stage.junction_ahead_m() - 2.1
    across = road_edge_m(stage, "right") + road_edge_m(stage, "left")
    for k in range(3):
        stage.walker(
            crosswalk + 0.8 * (k - 1),
            from_right_m=road_edge_m(stage, "right") + 1.5 + 0.7 * k,
            walks_m=across + 3.0 + 0.7 * k,
            speed_mps=stage.draw(f"walker speed {k}", 1.3, 2.0),
            delay_s=stage.draw(f"walker idle {k}", 0.0, 1.5),
            trigger=Arrival(3.5, 12.0),
        )
    stage.green_for_ego()
    scenery(stage, (60.0, 120.0))
    stage.end_m = stage.trigger_m + crosswalk + 20.0


@scenario("VehicleTurningRoute")
def vehicle_turning_route(stage: Stage) -> None:
    """A cyclist crosses 11 m after the turn at 1.8 m/s; starts when the ego is 1.8 s or 6 m away."""
    _crosses_after_turn(stage, 11.0, ActorKind.BICYCLE, Arrival(1.8, 6.0))


@scenario("VehicleTurningRoutePedestrian")
def vehicle_turning_route_pedestrian(stage: Stage) -> None:
    """A pedestrian crosses the exit of the turn from its outer side, at 1.8 m/s, when the ego is 2.2 s or 6 m away."""
    outer = "left" if stage.first_passage().turn_rad > 0.0 else "right"
    _crosses_after_turn(stage, 2.1, ActorKind.PEDESTRIAN, Arrival(2.2, 6.0), side=outer)


def _steps_out(stage: Stage, at_m: float, aside_m: float, *, beyond_m: float, tta_s: float) -> None:
    """Let a pedestrian start `aside_m` beside the ego's path and cross the road to `beyond_m` past its far edge."""
    far_side = "left" if right_hand(stage) > 0.0 else "right"
    angle = min(max(stage.spec.number("crossing_angle", 0.0), -30.0), 30.0)  # limited, to get across in time
    stage.walker(
        at_m,
        from_right_m=right_hand(stage) * aside_m,
        walks_m=aside_m + road_edge_m(stage, far_side, at_m) + beyond_m,
        speed_mps=2.0,
        trigger=Arrival(tta_s + _LATER_S * abs(angle), 6.0),
        slant_rad=math.radians(angle),
    )
    scenery(stage)
    stage.end_m = stage.trigger_m + at_m + 20.0


def _crosses_after_turn(
    stage: Stage, behind_exit_m: float, kind: ActorKind, trigger: Arrival, *, side: str = "right"
) -> None:
    """Let an actor start on one `side` of the road that the ego turns into, and cross the whole road."""
    at = stage.exit_ahead_m() + behind_exit_m
    # on the sidewalk, as Bench2Drive's actors
    start = road_edge_m(stage, side, at) + stage.draw("kerb", 0.9, 1.5)
    across = start + road_edge_m(stage, "left" if side == "right" else "right", at) + 1.5
    stage.walker(
        at, from_right_m=start if side == "right" else -start, walks_m=across, speed_mps=1.8, trigger=trigger, kind=kind
    )
    stage.green_for_ego()
    scenery(stage, (60.0, 120.0))
    stage.end_m = stage.trigger_m + at + 10.0
