"""`reactive` brakes for what is ahead in its lane and knows of nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from privileged_scene import actor, observation, street

from drive_robust_agents._planning.control import pedals, speed_profile, steer_along
from drive_robust_agents.reactive import Reactive
from pytest_drive_robust import Control, GlobalPlan
from pytest_drive_robust.domain.truth import ActorKind, EgoState, GroundTruth, LightState


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


def test_curves_are_slower_and_braking_for_them_starts_before() -> None:
    s = np.arange(100.0)
    turn = np.where(s < 50.0, 0.0, (s - 50.0) / 15.0)
    route = np.column_stack([np.cumsum(np.cos(turn)), np.cumsum(np.sin(turn)), turn, np.full(100, 12.0)])
    limits = speed_profile(route, lateral_mps2=2.8, brake_mps2=2.0)
    assert limits[80] == pytest.approx(math.sqrt(2.8 * 15.0), rel=0.02)
    assert limits[0] == 12.0
    assert np.all(np.diff(limits[20:50]) <= 0.0)
    assert np.all(limits[:-1] ** 2 - limits[1:] ** 2 <= 2.0 * 2.0 + 1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_on_a_circle_the_wheels_keep_the_curvature_of_the_circle(sign: float) -> None:
    angle = np.arange(60) / 20.0
    line = np.column_stack([20.0 * np.sin(angle), sign * 20.0 * (1.0 - np.cos(angle)), sign * angle])
    slip = math.atan(0.5 * 2.85 / 20.0)
    ego = EgoState(*line[20, :2], line[20, 2] - sign * slip, 5.0, 0.0, 0.0, sign * 5.0 / 20.0, 4.9, 1.8)
    assert steer_along(ego, line, 20) * 0.61 == pytest.approx(sign * math.atan(2.85 / 20.0), abs=0.02)


def test_a_standing_ego_is_held_by_its_brake() -> None:
    ego = EgoState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.9, 1.8)
    assert pedals(ego, -1.0, 0.0).brake == 0.5
    assert pedals(ego, 2.0, 0.0).throttle > 0.3
