"""Traffic on the ego's own road decides: it stands, it brakes, it wants to pass, it leaves few gaps.

Source: Bench2Drive `scenario_runner/srunner/scenarios/yield_to_emergency_vehicle.py`.
"""

from __future__ import annotations

import math
from contextlib import suppress

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.actors import SIZES, ActorSpec, Arrival, Passing, Script
from pytest_drive_robust.simulators.embedded.scenarios.parts import right_hand, rolling_start, scenery
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

_AHEAD_M = (25.0, 95.0)
"""Places of cars in the lane to the right, where the ego must find room."""
_STOP_S = 10.0
_AT_LEAST_M = 8.0
_ROW_STEP_M = 8.0
_SIREN_MPS2 = 15.0
"""Acceleration of the emergency vehicle: high, because Bench2Drive's has its speed at once."""


@scenario("YieldToEmergencyVehicle", parameters={"distance": (26.0, 30.0)})
def yield_to_emergency_vehicle(stage: Stage) -> None:
    """An emergency vehicle closes in from behind in the left lane; let it past within ten seconds."""
    distance = stage.spec.number("distance", 28.0)
    stage.emergency_actor = stage.cast.add(
        ActorSpec(
            ActorKind.EMERGENCY, stage.ego_path, stage.on_ego_path(-distance), target_mps=stage.speed_limit_mps,
            accel_mps2=_SIREN_MPS2, brake_mps2=8.0, appears=True,
        )
    )  # fmt: skip
    stage.cast.script(stage.emergency_actor, Passing(stage.trigger_m), Script(25.0, relative=c.SPEED_ABOVE))
    cruise = 0.8 * stage.speed_limit_mps
    with suppress(RouteError):  # a one-way street has no oncoming lane
        stage.flow(stage.oncoming(), speed_mps=cruise, gap_m=(45.0, 90.0), background=True)
    right = stage.beside("right")
    for ahead_m in _AHEAD_M:
        at_m = stage.along(right, ahead_m)
        stage.cast.add(
            ActorSpec(ActorKind.CAR, right, at_m, cruise, end_m=stage.length_m(right), leaves=True, background=True)
        )
    stage.end_m = stage.dense.length_m


@scenario("BlockedIntersection", blocked_test_off=True)
def blocked_intersection(stage: Stage) -> None:
    """After a turn a car stands 5 m behind the exit; it leaves 10 s after the ego came within 13 m.

    Who waits for it before the junction counts as near, too.
    """
    at = stage.exit_ahead_m() + 5.0 + SIZES[ActorKind.VAN].length_m / 2.0
    entry = stage.spot(stage.junction_ahead_m() - 9.0)
    cruise = 0.8 * stage.speed_limit_mps
    leaves_m = stage.length_m(stage.ego_path)
    blocker = stage.cast.add(
        ActorSpec(ActorKind.VAN, stage.ego_path, stage.on_ego_path(at), end_m=leaves_m, leaves=True)
    )
    near = Arrival(0.0, max(13.0, math.dist(entry, stage.spot(at))))
    stage.cast.script(blocker, near, Script(cruise, delay_s=_STOP_S), at=stage.spot(at))
    stage.green_for_ego()
    stage.end_m = stage.trigger_m + at + 10.0


@scenario("HardBreakRoute")
def hard_brake(stage: Stage) -> None:
    """Two cars lead the ego, 15 m apart or more; both brake hard and stand for ten seconds.

    On fast roads everybody starts rolling.
    """
    cruise = 0.85 * stage.speed_limit_mps
    start = rolling_start(stage)
    apart = 15.0 + 0.8 * start
    for k in range(2):
        start_m = stage.on_ego_path(1.0 + apart * (k + 1) - stage.trigger_m)
        leader = stage.cast.add(
            ActorSpec(
                ActorKind.CAR if k else ActorKind.VAN, stage.ego_path, start_m, max(start, 2.0), target_mps=cruise,
                leash=True, background=True, brake_mps2=7.5,
            )
        )  # fmt: skip
        stage.cast.script(leader, Passing(stage.trigger_m + 18.0), Script(0.0, seconds=_STOP_S, after_mps=cruise))
    scenery(stage)
    stage.end_m = stage.dense.length_m - 10.0


@scenario(
    "ParkingExit",
    parameters={
        "front_vehicle_distance": (9.0, 9.0),
        "behind_vehicle_distance": (9.0, 9.0),
        "flow_distance": (25.0, 25.0),
    },
    blocked_test_off=True,
)
def parking_exit(stage: Stage) -> None:
    """Parked cars 9 m ahead and behind, a car beside the ego drives off, traffic follows 25 m apart."""
    kerb = right_hand(stage) * (stage.lane_width_m / 2.0 + 1.2)
    stage.start_right_m = kerb
    front = max(stage.spec.number("front_vehicle_distance", 9.0), _AT_LEAST_M) - stage.trigger_m
    behind = max(stage.spec.number("behind_vehicle_distance", 9.0), _AT_LEAST_M) + stage.trigger_m
    for k in range(3):
        stage.stand(ActorKind.CAR, front + _ROW_STEP_M * k, kerb)
    for k in range(2):
        stage.stand(ActorKind.CAR, -behind - _ROW_STEP_M * k, kerb)
    cruise = 0.7 * stage.speed_limit_mps
    lane = stage.own()
    stage.cast.add(
        ActorSpec(
            ActorKind.CAR, lane, stage.along(lane, -stage.trigger_m), target_mps=cruise, background=True,
            end_m=stage.length_m(lane), leaves=True,
        )
    )  # fmt: skip
    gap = max(stage.spec.number("flow_distance", 25.0), 12.0)
    stage.flow(lane, speed_mps=cruise, gap_m=(gap, 1.3 * gap), background=True)
    scenery(stage)
    stage.end_m = stage.trigger_m + 50.0
