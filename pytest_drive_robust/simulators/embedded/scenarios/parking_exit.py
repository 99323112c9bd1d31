"""The ego stands in a parked row: find a gap in the traffic and join it.

Source: Bench2Drive `scenario_runner/srunner/scenarios/parking_exit.py`.
"""

from __future__ import annotations

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded.actors import ActorSpec
from pytest_drive_robust.simulators.embedded.scenarios.roadside import right_hand, scenery
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__ = ["parking_exit"]

_AT_LEAST_M = 8.0
_ROW_STEP_M = 8.0


@scenario(
    "ParkingExit",
    sites=(
        Site("ParkingStreet", "road.f0", (125.0, 140.0), trigger_m=(0.5, 1.5)),
        Site("ParkingAvenue", "road.f1", (125.0, 140.0), trigger_m=(0.5, 1.5)),
        Site("OneWayStreet", "road.f1", (125.0, 140.0), trigger_m=(0.5, 1.5)),
    ),
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
