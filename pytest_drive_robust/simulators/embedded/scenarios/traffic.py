"""The traffic around the ego does something: a hard brake ahead, an emergency vehicle behind."""

from __future__ import annotations

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded.actors import Script
from pytest_drive_robust.simulators.embedded.scenarios.base import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.triggers import Passing

__all__ = ["hard_brake", "yield_to_emergency_vehicle"]

_STOP_S = 10.0


@scenario("HardBreakRoute", sites=(Site("Street", "road.f0", (120.0, 145.0), trigger_m=(20.0, 30.0)),))
def hard_brake(stage: Stage) -> None:
    """Two cars lead the ego, 15 m apart; both brake hard and stand for ten seconds."""
    cruise = 0.85 * stage.speed_limit_mps
    for k in range(2):
        leader = stage.drive(
            ActorKind.CAR if k else ActorKind.VAN,
            stage.ego_path,
            stage.on_ego_path(16.0 + 15.0 * k - stage.trigger_m),
            2.0,
            target_mps=cruise,
            leash=True,
            background=True,
            brake_mps2=7.5,
        )
        stage.cast.script(leader, Passing(stage.trigger_m + 18.0), Script(0.0, seconds=_STOP_S, after_mps=cruise))
    stage.flow(stage.oncoming(), speed_mps=cruise, gap_m=(45.0, 90.0), background=True)
    stage.end_m = stage.dense.length_m - 10.0


@scenario(
    "YieldToEmergencyVehicle",
    sites=(Site("Avenue", "road.f0", (150.0, 180.0), trigger_m=(20.0, 30.0)),),
    parameters={"distance": (26.0, 30.0)},
)
def yield_to_emergency_vehicle(stage: Stage) -> None:
    """An emergency vehicle closes in from behind in the left lane; let it past within ten seconds."""
    distance = stage.spec.number("distance", 28.0)
    stage.emergency_actor = stage.drive(
        ActorKind.EMERGENCY, stage.ego_path, stage.on_ego_path(-distance), 0.0, target_mps=stage.speed_limit_mps,
        accel_mps2=4.0, brake_mps2=8.0, appears=True,
    )  # fmt: skip
    stage.cast.script(stage.emergency_actor, Passing(stage.trigger_m), Script(25.0, relative=2))
    stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=(45.0, 90.0), background=True)
    stage.flow(
        stage.beside("right"),
        speed_mps=0.8 * stage.speed_limit_mps,
        gap_m=(60.0, 90.0),
        source_m=stage.along(stage.beside("right"), 45.0 - stage.trigger_m),
        background=True,
    )
    stage.end_m = stage.dense.length_m
