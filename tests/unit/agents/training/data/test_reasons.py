"""Sentences say what the facts say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("torch")

from simlingo_samples import FREE

from drive_robust_agents.training.data.commentary import Action, Commentary, Reason
from drive_robust_agents.training.data.reasons import action_of, commentary, hindrances, turn_ahead_rad

METRES = np.arange(1.0, 25.0)
STRAIGHT = np.stack([METRES, np.zeros(24)], axis=1)


@pytest.mark.parametrize(
    ("facts", "speed", "later", "sentence"),
    [
        ({}, 8.0, 8.0, "maintain speed because the road is clear"),
        ({}, 2.0, 8.0, "accelerate because the road is clear"),
        ({"light": 2.0, "light_m": 15.0}, 8.0, 0.0, "stop because of the red light"),
        ({"light": 2.0, "light_m": 1.0}, 0.0, 0.0, "remain stopped because of the red light"),
        ({"light": 1.0, "light_m": 25.0}, 8.0, 4.0, "slow down because of the yellow light"),
        ({"light": 0.0, "light_m": 3.0}, 0.0, 5.0, "accelerate because the light is green"),
        ({"light": 3.0, "light_m": 9.0}, 6.0, 0.0, "stop because of the stop sign"),
        ({"lead_m": 9.0, "lead_mps": 2.0}, 7.0, 2.0, "slow down because of the vehicle ahead"),
        ({"lead_m": 15.0, "lead_mps": 8.0}, 8.0, 8.0, "maintain speed and follow the vehicle ahead"),
        ({"lead_m": 4.0, "light": 2.0, "light_m": 20.0}, 0.0, 0.0, "remain stopped because of the vehicle ahead"),
        ({"lead_m": 25.0, "light": 2.0, "light_m": 12.0}, 8.0, 0.0, "stop because of the red light"),
        ({"walker_m": 10.0}, 8.0, 0.0, "stop because of the pedestrian ahead"),
        ({"obstacle_m": 10.0}, 8.0, 2.0, "slow down because of the obstacle ahead"),
        ({"obstacle_m": 10.0, "waiting": 1.0}, 0.0, 0.0, "remain stopped and wait for a gap in traffic"),
        ({"obstacle_m": 10.0, "passing": 1.0}, 6.0, 6.0, "maintain speed and pass the obstacle ahead"),
        ({"junction_m": 6.0}, 8.0, 4.0, "slow down because of the junction ahead"),
        ({"siren": 1.0}, 8.0, 4.0, "slow down because of the emergency vehicle behind"),
        ({"limit_mps": 5.0}, 8.0, 5.0, "slow down because of the speed limit"),
        ({}, 8.0, 5.0, "slow down"),
    ],
)
def test_the_sentence_of_a_situation(facts: dict[str, float], speed: float, later: float, sentence: str) -> None:
    speeds = np.linspace(speed, later, 13)[1:]
    assert commentary(FREE | facts, speed, speeds, STRAIGHT).text == sentence


def test_a_curve_is_a_reason_to_slow_down() -> None:
    angle = 0.05 * METRES
    curve = np.stack([np.sin(angle) / 0.05, (1.0 - np.cos(angle)) / 0.05], axis=1)
    assert turn_ahead_rad(curve) == pytest.approx(1.1, abs=0.1)
    assert commentary(FREE, 9.0, np.linspace(9.0, 5.0, 12), curve) == Commentary(Action.SLOW, Reason.CURVE)


@given(st.floats(0.0, 20.0), st.floats(0.0, 20.0))
def test_the_action_says_what_the_speed_does(speed: float, later: float) -> None:
    action = action_of(speed, np.linspace(speed, later, 13)[1:])
    if action is Action.GO:
        assert later > speed
    if action in (Action.SLOW, Action.STOP):
        assert later < speed
    if action is Action.KEEP:
        assert abs(later - speed) < 1.3


def test_the_nearest_hindrance_comes_first() -> None:
    facts = FREE | {"lead_m": 20.0, "light": 2.0, "light_m": 12.0, "walker_m": 16.0}
    assert [reason for _, reason in hindrances(facts, 8.0)] == [Reason.RED, Reason.PEDESTRIAN, Reason.VEHICLE]
    assert hindrances(facts | {"light": 0.0}, 0.0) == []
