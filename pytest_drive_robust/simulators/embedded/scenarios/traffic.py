"""The traffic around the ego does something: an emergency vehicle wants to pass.

Source: Bench2Drive `scenario_runner/srunner/scenarios/yield_to_emergency_vehicle.py`.
"""

from __future__ import annotations

from contextlib import suppress

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.actors import ActorSpec, Script
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.triggers import Passing

__all__ = ["yield_to_emergency_vehicle"]

_AHEAD_M = (25.0, 95.0)
"""Cars in the lane to the right, where the ego must find room."""


@scenario(
    "YieldToEmergencyVehicle",
    sites=(
        Site("Avenue", "road.f0", (125.0, 145.0), trigger_m=(12.0, 20.0)),
        Site("OneWayStreet", "road.f0", (125.0, 145.0), trigger_m=(12.0, 20.0)),
        Site("ParkingAvenue", "road.f0", (125.0, 145.0), trigger_m=(12.0, 20.0)),
    ),
    parameters={"distance": (26.0, 30.0)},
)
def yield_to_emergency_vehicle(stage: Stage) -> None:
    """An emergency vehicle closes in from behind in the left lane; let it past within ten seconds."""
    distance = stage.spec.number("distance", 28.0)
    stage.emergency_actor = stage.cast.add(
        ActorSpec(
            ActorKind.EMERGENCY, stage.ego_path, stage.on_ego_path(-distance), target_mps=stage.speed_limit_mps,
            accel_mps2=4.0, brake_mps2=8.0, appears=True,
        )
    )  # fmt: skip
    stage.cast.script(stage.emergency_actor, Passing(stage.trigger_m), Script(25.0, relative=2))
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
