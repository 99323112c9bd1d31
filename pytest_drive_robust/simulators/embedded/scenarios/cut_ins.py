"""Somebody pulls into the ego's lane: make room.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{parking_cut_in,route_obstacles,highway_cut_in}.py`.
"""

from __future__ import annotations

import numpy as np

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.actors import ActorSpec, Arrival, Passing, Script
from pytest_drive_robust.simulators.embedded.geometry import project
from pytest_drive_robust.simulators.embedded.scenarios.parts import KMH, ahead, right_hand, rolling_start, scenery
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

_BEFORE_LANE_END_M = 45.0
_PULLS_OUT_MPS, _PULLS_OUT_M = 20.0 * KMH, 30.0
_GEAR_S = 0.5
"""A parked car of CARLA shifts into first gear before it moves (`VehiclePhysicsControl.gear_switch_time`)."""
_ROW_STEP_M = 11.0
_EDGES_OUT_MPS, _EDGES_OUT_S, _TURNS_WITHIN_M = 0.8, 3.0, 3.6
_ROW = (-2, -1, 1, 2, 3)
"""Places of the standing cars in the row, behind (negative) and ahead of the car that cuts in."""


@scenario("ParkingCutIn", parameters={"distance": (35.0, 35.0)})
def parking_cut_in(stage: Stage) -> None:
    """A parked car 35 m ahead pulls out from behind another one at 28 m; it starts at 2.35 s or 10 m.

    It drives 30 m at 20 km/h, the speed of CARLA's basic agent when nobody names one, and then as fast as others.
    """
    at = ahead(stage, 35.0)
    kerb = right_hand(stage) * (stage.lane_width_m / 2.0 + 1.2)
    stage.stand(ActorKind.VAN, at - 7.0, kerb)
    for k in range(1, 4):
        stage.stand(ActorKind.CAR, at + 14.0 + 9.0 * k, kerb)
    start_m = stage.on_ego_path(at)
    cutter = stage.cast.add(
        ActorSpec(ActorKind.CAR, stage.ego_path, start_m, right_m=kerb, lateral_mps=1.8, accel_mps2=2.5)
    )
    stage.cast.script(
        cutter,
        Arrival(2.35, 10.0),
        Script(_PULLS_OUT_MPS, seconds=_PULLS_OUT_M / _PULLS_OUT_MPS, after_mps=stage.speed_limit_mps, delay_s=_GEAR_S),
        at=stage.spot(at),
    )
    scenery(stage)
    stage.end_m = stage.trigger_m + at + 40.0


@scenario("StaticCutIn", parameters={"distance": (45.0, 60.0)})
def static_cut_in(stage: Stage) -> None:
    """Out of a standing row on the next lane one car cuts in at 60 km/h; it starts at 2.7 s or 15 m.

    The row begins `distance` metres ahead with the two cars behind that one. It edges out first, nose across the lane:
    it has no speed yet that would stretch its change of lanes, and CARLA's basic agent keeps 5 m, and a metre more for
    each metre per second, to the car that stands 11 m ahead until it has left that lane.
    """
    at = ahead(stage, 42.0) + _ROW_STEP_M * -_ROW[0]
    beside = stage.lane_width_m if _stands_right(stage) else -stage.lane_width_m
    for k in _ROW:
        stage.stand(ActorKind.CAR if k % 2 else ActorKind.VAN, at + _ROW_STEP_M * k, beside)
    cutter = stage.cast.add(
        ActorSpec(ActorKind.CAR, _way_out(stage, at, beside), 0.0, accel_mps2=3.0, sees=c.SEES_NOBODY)
    )
    stage.cast.script(
        cutter,
        Arrival(2.7, 15.0),
        Script(_EDGES_OUT_MPS, seconds=_EDGES_OUT_S, after_mps=60.0 * KMH),
        at=stage.spot(at),
    )
    scenery(stage)
    stage.end_m = stage.trigger_m + at + 50.0


@scenario("HighwayCutIn", parameters={"distance": (35.0, 45.0)})
def highway_cut_in(stage: Stage) -> None:
    """A car on the lane to the right keeps abreast, then cuts in 10 m ahead at 80 % of the ego's speed in two seconds.

    The 10 m are from middle to middle. It keeps that speed for the way of 5.5 s at the ego's: 0.3 s in its lane, two to
    change, three in the other, in steps of two metres. The ego starts rolling.
    """
    at = _merges_ahead_m(stage)
    width = _side_of_other(stage) * stage.lane_width_m
    cutter = stage.cast.add(
        ActorSpec(
            ActorKind.CAR, stage.ego_path, stage.on_ego_path(10.0 - stage.trigger_m), rolling_start(stage),
            right_m=width, lateral_mps=stage.lane_width_m / 2.0, sync_m=10.0, accel_mps2=5.0, background=True,
        )
    )  # fmt: skip
    stage.cast.script(
        cutter,
        Passing(stage.trigger_m + at),
        Script(0.8, seconds=5.5 / 0.8, after_mps=0.9 * stage.speed_limit_mps, relative=c.SPEED_SHARE),
    )
    if stage.has_lane_beside("left"):
        stage.flow(stage.beside("left"), speed_mps=0.95 * stage.speed_limit_mps, gap_m=(45.0, 90.0), background=True)
    stage.end_m = stage.trigger_m + at + 70.0


def _stands_right(stage: Stage) -> bool:
    """Return whether the standing row is on the right lane: when the file says so, or without a left lane."""
    right, left = stage.has_lane_beside("right"), stage.has_lane_beside("left")
    return right and (right_hand(stage) > 0.0 or not left)


def _way_out(stage: Stage, ahead_m: float, right_m: float) -> int:
    """Return a path from a standing row beside the ego's path into the ego's path, and along it to its end."""
    length = stage.length_m(stage.ego_path) - stage.on_ego_path(ahead_m)
    along = np.concatenate([np.arange(0.0, _TURNS_WITHIN_M, 0.2), np.arange(_TURNS_WITHIN_M, length, 1.0)])
    share = np.clip(along / _TURNS_WITHIN_M, 0.0, 1.0)
    aside = right_m * (1.0 - share * share * (3.0 - 2.0 * share))
    places = [stage.spot(ahead_m + s, r) for s, r in zip(along.tolist(), aside.tolist(), strict=True)]
    return stage.add_path(np.array(places))


def _merges_ahead_m(stage: Stage) -> float:
    """Return metres from the trigger to the cut-in: the element `distance`, or a fixed way before `end_location`."""
    end = stage.spec.parameters.get("end_location")
    if end is None or "x" not in end or "y" not in end:
        return max(stage.spec.number("distance", 40.0), 10.0)
    lane_end_m = project(stage.paths[stage.ego_path], end["x"], end["y"])[0] - stage.on_ego_path(0.0)
    return min(max(lane_end_m - _BEFORE_LANE_END_M, 10.0), stage.dense.length_m - stage.trigger_m - 10.0)


def _side_of_other(stage: Stage) -> float:
    """Return -1 when `other_actor_location` puts the other car to the left, else 1."""
    other = stage.spec.parameters.get("other_actor_location")
    if other is None or "x" not in other or "y" not in other:
        return 1.0
    return 1.0 if project(stage.paths[stage.ego_path], other["x"], other["y"])[1] > 0.0 else -1.0
