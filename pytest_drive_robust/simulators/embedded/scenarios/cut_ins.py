"""Somebody pulls into the ego's lane: make room."""

from __future__ import annotations

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded.actors import Script
from pytest_drive_robust.simulators.embedded.scenarios.base import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.triggers import Arrival, Passing

__all__ = ["highway_cut_in", "parking_cut_in"]


@scenario(
    "ParkingCutIn",
    sites=(Site("ParkingStreet", "road.f0", (125.0, 145.0)),),
    parameters={"distance": (35.0, 35.0)},
)
def parking_cut_in(stage: Stage) -> None:
    """A parked car 35 m ahead pulls out from behind another one at 28 m; it starts at 2.35 s or 10 m."""
    distance = stage.spec.number("distance", 35.0)
    kerb = stage.lane_width_m / 2.0 + 1.2
    stage.stand(ActorKind.VAN, distance - 7.0, kerb)
    for k in range(1, 4):
        stage.stand(ActorKind.CAR, distance + 14.0 + 9.0 * k, kerb)
    cutter = stage.drive(
        ActorKind.CAR, stage.ego_path, stage.on_ego_path(distance), 0.0, right_m=kerb, lateral_mps=1.8, accel_mps2=2.5
    )
    cruise = 0.5 * stage.speed_limit_mps
    stage.cast.script(
        cutter,
        Arrival(2.35, 10.0),
        Script(cruise, seconds=8.0, after_mps=stage.speed_limit_mps),
        at=stage.spot(distance),
    )
    stage.flow(stage.oncoming(), speed_mps=0.8 * stage.speed_limit_mps, gap_m=(45.0, 90.0), background=True)
    stage.end_m = stage.trigger_m + distance + 40.0


@scenario(
    "HighwayCutIn",
    sites=(Site("Highway", "road.f1", (190.0, 215.0)),),
    parameters={"distance": (55.0, 75.0)},
)
def highway_cut_in(stage: Stage) -> None:
    """A car on the entry lane keeps abreast, then cuts in 10 m ahead at 80 % of the ego's speed within two seconds."""
    distance = stage.spec.number("distance", 65.0)
    width = stage.lane_width_m
    cutter = stage.drive(
        ActorKind.CAR, stage.ego_path, stage.on_ego_path(24.0), 8.0, right_m=width, lateral_mps=width / 2.0,
        sync_m=10.0 + 4.8, accel_mps2=5.0, background=True,
    )  # fmt: skip
    stage.cast.script(
        cutter,
        Passing(stage.trigger_m + distance),
        Script(0.8, seconds=5.0, after_mps=0.9 * stage.speed_limit_mps, relative=1),
    )
    stage.flow(stage.beside("left"), speed_mps=0.95 * stage.speed_limit_mps, gap_m=(45.0, 90.0), background=True)
    stage.end_m = stage.trigger_m + distance + 70.0
