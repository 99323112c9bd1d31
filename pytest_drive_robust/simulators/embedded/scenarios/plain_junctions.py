"""A junction where nobody is scripted: obey its lights and signs, give way to whoever comes."""

from __future__ import annotations

from pytest_drive_robust.simulators.embedded.scenarios.parts import (
    RED_S,
    cross_traffic,
    end_behind_junction,
    lights_turn_green,
    lights_turn_red,
)
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Site, scenario, sites
from pytest_drive_robust.simulators.embedded.stage import Stage

_NEAR_M = (28.0, 36.0)
_NEARER_M = (23.0, 30.0)
"""Metres before a junction at which a route starts; plain turns are the shortest routes."""
_TRIGGER_M = (3.0, 6.0)
_RED_S = (6.0, 28.0)
"""CARLA's lights give one arm after the other ten seconds of green, three of yellow and two of nothing: of three arms
each is red for up to 32 s. Less is drawn at both ends, so that nobody stands for half a minute."""
_ARM_S, _OTHER_ARMS = 15.0, 0.75


@scenario(
    "T_Junction",
    sites=sites(
        ("LightTee", "S.left0", (90.0, 112.0)),
        ("StopTee", "S.left0", (90.0, 112.0)),
        ("LightTee", "E.left0", (90.0, 112.0)),
        ("StopTee", "S.right0", (90.0, 112.0)),
        trigger_m=(4.0, 10.0),
        before_m=(48.0, 60.0),
    ),
    blocked_test_off=True,
)
def t_junction(stage: Stage) -> None:
    """A junction of three arms with lights or a stop sign on the stem; the other arms carry traffic."""
    lights = any(line.is_light for line in stage.dense.lane_map.stop_lines)
    if lights:
        lights_turn_green(stage, red_s=stage.draw("red", *_RED_S))
    cross_traffic(stage, lights=lights)
    end_behind_junction(stage)


@scenario(
    "VanillaNonSignalizedTurn",
    sites=(
        Site("OpenCrossing", "E.left0", (52.0, 66.0), trigger_m=_TRIGGER_M, before_m=_NEARER_M),
        Site("OpenTee", "S.left0", (52.0, 66.0), trigger_m=_TRIGGER_M, before_m=_NEARER_M),
        Site("Roundabout", "W.straight0", (80.0, 95.0), trigger_m=_TRIGGER_M, before_m=_NEAR_M),
        Site("OpenTee", "S.right0", (49.2, 62.0), trigger_m=_TRIGGER_M, before_m=_NEARER_M),
    ),
)
def vanilla_turn(stage: Stage) -> None:
    """A plain turn where nothing is controlled; there is traffic on the other road."""
    cross_traffic(stage)
    end_behind_junction(stage)


@scenario(
    "VanillaNonSignalizedTurnEncounterStopsign",
    sites=sites(
        ("StopCrossing", "E.right0", (49.2, 60.0)),
        ("StopCrossing", "W.left0", (54.0, 68.0)),
        ("StopTee", "S.right0", (49.5, 60.0)),
        ("RuralCrossing", "N.right0", (52.0, 68.0)),
        trigger_m=_TRIGGER_M,
        before_m=_NEARER_M,
    ),
)
def vanilla_stop_sign(stage: Stage) -> None:
    """A plain turn behind a stop sign: come to rest, then go."""
    end_behind_junction(stage)


@scenario(
    "VanillaSignalizedTurnEncounterGreenLight",
    sites=sites(
        ("LightCrossing", "E.right0", (80.0, 94.0)),
        ("LightTee", "W.right0", (80.0, 94.0)),
        ("LightAvenueCrossing", "S.left0", (86.0, 100.0)),
        trigger_m=(2.0, 4.0),
        before_m=(54.0, 64.0),
    ),
)
def vanilla_green_light(stage: Stage) -> None:
    """A plain turn; the light is green for five seconds, then red for five: one arrives just as it changes.

    Then lights go on as usual in CARLA: the next green is that of one of the arms, in one of four cases the ego's.
    """
    lights_turn_red(stage, red_s=RED_S + (_ARM_S if stage.draw("arm", 0.0, 1.0) < _OTHER_ARMS else 0.0))
    cross_traffic(stage, lights=True)
    end_behind_junction(stage)


@scenario(
    "VanillaSignalizedTurnEncounterRedLight",
    sites=sites(
        ("LightCrossing", "S.right0", (49.5, 60.0)),
        ("LightCrossing", "N.left0", (54.0, 68.0)),
        ("LightTee", "S.left0", (52.0, 66.0)),
        ("Grid", "W0.right0", (50.0, 62.0)),
        trigger_m=_TRIGGER_M,
        before_m=_NEARER_M,
    ),
)
def vanilla_red_light(stage: Stage) -> None:
    """A plain turn; the light is red for five seconds, then green."""
    lights_turn_green(stage)
    cross_traffic(stage, lights=True)
    end_behind_junction(stage)
