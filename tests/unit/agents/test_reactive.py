"""`reactive` brakes for what is ahead in its lane and knows of nothing else."""

from __future__ import annotations

import math

import pytest
from privileged_scene import actor, observation, street

from drive_robust_agents.reactive import Reactive
from pytest_drive_robust import Control, GlobalPlan
from pytest_drive_robust.domain.truth import ActorKind, GroundTruth, LightState


def act(truth: GroundTruth) -> Control:
    agent = Reactive()
    agent.reset(GlobalPlan(()), 0)
    return agent.act(observation(truth))


def test_it_drives_off_on_an_empty_road() -> None:
    control = act(street())
    assert control.throttle > 0.3
    assert control.brake == 0.0


def test_it_brakes_for_a_car_that_stands_in_its_lane() -> None:
    assert act(street(actor(38.0, 0.0), speed_mps=10.0)).brake > 0.5


def test_it_does_not_brake_for_a_car_in_the_other_lane() -> None:
    assert act(street(actor(38.0, -3.5), speed_mps=10.0)).brake == 0.0


def test_it_follows_a_car_at_its_speed_without_braking_hard() -> None:
    control = act(street(actor(45.0, 0.0, speed_mps=9.0), speed_mps=9.0))
    assert control.brake < 0.1


def test_it_does_not_see_who_is_about_to_walk_into_the_lane() -> None:
    walker = actor(35.0, 3.0, speed_mps=2.0, yaw_rad=-math.pi / 2.0, kind=ActorKind.PEDESTRIAN)
    assert act(street(walker, speed_mps=10.0)).brake == 0.0


@pytest.mark.parametrize("state", [LightState.RED, LightState.STOP_SIGN])
def test_lights_and_signs_mean_nothing_to_it(state: LightState) -> None:
    assert act(street(light=(30.0, state), speed_mps=10.0)).brake == 0.0


def test_it_keeps_to_the_speed_limit() -> None:
    assert act(street(speed_mps=15.0)).throttle == 0.0


def test_it_steers_back_onto_its_lane() -> None:
    assert act(street(right_m=-0.8, speed_mps=8.0)).steer > 0.05
    assert act(street(right_m=0.8, speed_mps=8.0)).steer < -0.05


def test_without_ground_truth_it_says_what_it_needs() -> None:
    with pytest.raises(ValueError, match="privileged"):
        Reactive().act(observation(None))
