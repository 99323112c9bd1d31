"""Somebody drives into the junction who should have waited: brake, although you have the right of way.

Source: Bench2Drive `scenario_runner/srunner/scenarios/opposite_vehicle_taking_priority.py`.
"""

from __future__ import annotations

import math
from contextlib import suppress

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.actors import ActorSpec, Arrival, Script
from pytest_drive_robust.simulators.embedded.light_programs import GREEN, RED
from pytest_drive_robust.simulators.embedded.scenarios.parts import end_behind_junction, meeting_point
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.state import DT_S

_SPEED_MPS = 60.0 / 3.6
_ACCEL_MPS2 = 15.0
"""Acceleration of the other vehicle: high, because Bench2Drive's vehicles have their speed at once."""
_TTA_S = 2.2
_WITHIN_M = 12.0
_BEARINGS = ("left", "right", "opposite")


@scenario("OppositeVehicleRunningRedLight")
def opposite_vehicle_running_red_light(stage: Stage) -> None:
    """The ego has green; an emergency vehicle runs the red at 60 km/h."""
    stage.lights(ego=GREEN, opposite=RED)
    _take_priority(stage, ActorKind.EMERGENCY)
    end_behind_junction(stage)


@scenario("OppositeVehicleTakingPriority")
def opposite_vehicle_taking_priority(stage: Stage) -> None:
    """Nothing is controlled; a car shoots out at 60 km/h although it should give way."""
    _take_priority(stage, ActorKind.CAR)
    end_behind_junction(stage)


def _take_priority(stage: Stage, kind: ActorKind) -> None:
    """Place a car so that it reaches the meeting point together with an ego that does not react."""
    path, ahead_m, meets_m = _way(stage)
    start_m = meets_m - _reach_m()
    runner = stage.cast.add(
        ActorSpec(
            kind, path, start_m, accel_mps2=_ACCEL_MPS2, sees=c.SEES_NOBODY, end_m=stage.length_m(path), leaves=True
        )
    )
    stage.cast.script(runner, Arrival(_TTA_S, _WITHIN_M), Script(_SPEED_MPS), at=stage.spot(ahead_m))


def _way(stage: Stage) -> tuple[int, float, float]:
    """Return (path, metres ahead, metres on the path) of the file's `direction`, else of the first crossing path.

    For a given `direction` the path need not cross, because the ego may turn right in front of the car. Raises
    `RouteError` when there is no such path.
    """
    asked = stage.spec.texts.get("direction")
    for bearing in _BEARINGS if asked is None else (asked,):
        with suppress(RouteError, KeyError):  # a junction of three arms lacks one bearing
            path = stage.from_arm(bearing)
            met = meeting_point(stage, path)
            if met is not None:
                return path, *met
    if asked is not None:
        with suppress(RouteError, KeyError):  # an ego that turns right only passes by the car
            path = stage.from_arm(asked)
            nearest = meeting_point(stage, path, within_m=math.inf)
            assert nearest is not None
            return path, *nearest
    raise RouteError(
        f"route {stage.dense.route.id}: nobody from {asked or 'anywhere'!r} crosses the route's first junction for "
        f"scenario {stage.spec.type}; directions are {', '.join(_BEARINGS)}"
    )


def _reach_m() -> float:
    """Return how far the driver model gets from rest within `_TTA_S` seconds."""
    v, s = 0.0, 0.0
    for _ in range(round(_TTA_S / DT_S)):
        share = (v / _SPEED_MPS) * (v / _SPEED_MPS)
        v += _ACCEL_MPS2 * (1.0 - share * share) * DT_S
        s += v * DT_S
    return s
