"""Traffic ahead comes to a halt: brake, wait, go on.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{blocked_intersection,hard_break}.py`.
"""

from __future__ import annotations

import math

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded.actors import SIZES_M, ActorSpec, Script
from pytest_drive_robust.simulators.embedded.scenarios.roadside import rolling_start, scenery
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Site, scenario
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.triggers import Arrival

__all__ = ["blocked_intersection", "hard_brake"]

_STOP_S = 10.0
_BEFORE_M = (30.0, 38.0)


@scenario(
    "BlockedIntersection",
    sites=(
        Site("OpenCrossing", "E.right0", (70.0, 80.0), trigger_m=(3.0, 8.0), before_m=_BEFORE_M),
        Site("LightCrossing", "N.left0", (72.0, 84.0), trigger_m=(3.0, 8.0), before_m=_BEFORE_M),
        Site("LightTee", "S.right0", (70.0, 80.0), trigger_m=(3.0, 8.0), before_m=_BEFORE_M),
        Site("Grid", "W1.left0", (72.0, 84.0), trigger_m=(3.0, 8.0), before_m=_BEFORE_M),
    ),
    blocked_test_off=True,
)
def blocked_intersection(stage: Stage) -> None:
    """After a turn a car stands 5 m behind the exit; it leaves 10 s after the ego came within 13 m.

    Who waits for it before the junction counts as near, too.
    """
    at = stage.exit_ahead_m() + 5.0 + SIZES_M[ActorKind.VAN][0] / 2.0
    entry = stage.spot(stage.junction_ahead_m() - 9.0)
    cruise = 0.8 * stage.speed_limit_mps
    blocker = stage.cast.add(ActorSpec(ActorKind.VAN, stage.ego_path, stage.on_ego_path(at), leaves=True))
    near = Arrival(0.0, max(13.0, math.dist(entry, stage.spot(at))))
    stage.cast.script(blocker, near, Script(cruise, delay_s=_STOP_S), at=stage.spot(at))
    stage.green_for_ego()
    stage.end_m = stage.trigger_m + at + 10.0


@scenario(
    "HardBreakRoute",
    sites=(
        Site("Street", "road.f0", (120.0, 140.0), trigger_m=(20.0, 30.0)),
        Site("Avenue", "road.f1", (120.0, 140.0), trigger_m=(20.0, 30.0)),
        Site("RuralRoad", "road.f0", (125.0, 145.0), trigger_m=(20.0, 30.0)),
        Site("Highway", "road.f1", (130.0, 150.0), trigger_m=(20.0, 30.0)),
    ),
)
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
        stage.cast.script(leader, stage.passing(18.0), Script(0.0, seconds=_STOP_S, after_mps=cruise))
    scenery(stage)
    stage.end_m = stage.dense.length_m - 10.0
