"""A junction where nobody is scripted: obey its lights and signs, give way to whoever comes."""

from __future__ import annotations

from pytest_drive_robust.simulators.embedded.scenarios import parts
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

_RED_S = (6.0, 28.0)
"""Range of the red phase. CARLA's lights give each arm in turn 10 s of green, 3 s of yellow and 2 s of all red, so each
of three arms is red for up to 32 s. Our range is shorter at both ends, so that no ego stands for half a minute."""
_ARM_S, _OTHER_ARMS = 15.0, 0.75


@scenario("T_Junction", blocked_test_off=True)
def t_junction(stage: Stage) -> None:
    """A junction of three arms with lights or a stop sign on the stem; the other arms carry traffic."""
    lights = any(line.is_light for line in stage.dense.lane_map.stop_lines)
    if lights:
        parts.lights_turn_green(stage, red_s=stage.draw("red", *_RED_S))
    parts.cross_traffic(stage, lights=lights)
    parts.end_behind_junction(stage)


@scenario("VanillaNonSignalizedTurn")
def vanilla_turn(stage: Stage) -> None:
    """A plain turn where nothing is controlled; there is traffic on the other road."""
    parts.cross_traffic(stage)
    parts.end_behind_junction(stage)


@scenario("VanillaNonSignalizedTurnEncounterStopsign")
def vanilla_stop_sign(stage: Stage) -> None:
    """A plain turn behind a stop sign: come to rest, then go."""
    parts.end_behind_junction(stage)


@scenario("VanillaSignalizedTurnEncounterGreenLight")
def vanilla_green_light(stage: Stage) -> None:
    """A plain turn; the light is green for five seconds, then red for five: one arrives just as it changes.

    Then lights go on as usual in CARLA: the next green is that of one of the arms, in one of four cases the ego's.
    """
    parts.lights_turn_red(stage, red_s=parts.RED_S + (_ARM_S if stage.draw("arm", 0.0, 1.0) < _OTHER_ARMS else 0.0))
    parts.cross_traffic(stage, lights=True)
    parts.end_behind_junction(stage)


@scenario("VanillaSignalizedTurnEncounterRedLight")
def vanilla_red_light(stage: Stage) -> None:
    """A plain turn; the light is red for five seconds, then green."""
    parts.lights_turn_green(stage)
    parts.cross_traffic(stage, lights=True)
    parts.end_behind_junction(stage)
