"""Labels: their geometry against the world that they were taken from."""

from __future__ import annotations

import math

import numpy as np
import pytest
from privileged_scene import actor, street
from training_drives import first_moment, route_of, samples_of

from drive_robust_agents._wrappers.route_planner import MIN_M, MIN_SIMLINGO_M, RoutePlanner
from drive_robust_agents.training.data.expert_episode import ExpertEpisode
from drive_robust_agents.training.data.facts import FACTS, NO_LIGHT, fact_labels
from drive_robust_agents.training.data.labels import (
    FUTURE_TICKS,
    gap_ahead,
    motion_labels,
    path_ahead,
    to_ego,
    way_labels,
)
from drive_robust_agents.training.data.rollouts import ON_WAY, Sample
from pytest_drive_robust import Control
from pytest_drive_robust.domain.truth import EgoState, LightState, WorldState

LIGHT = "VanillaSignalizedTurnEncounterRedLight"


def out_of(ego: EgoState, points: np.ndarray) -> np.ndarray:
    """Points of the ego frame in the route's frame: the other way round than `to_ego`."""
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    x, y = points[..., 0], points[..., 1]
    return np.stack([ego.x_m + c * x - s * y, ego.y_m + s * x + c * y], -1)


@pytest.fixture(scope="module")
def samples() -> tuple[Sample, ...]:
    return samples_of(LIGHT)


# --- motion ---


def test_the_ego_frame_is_forward_and_right() -> None:
    ego = EgoState(10.0, 20.0, math.pi / 2.0, 0.0, 0.0, 0.0, 0.0, 4.9, 1.8)  # to the south; west is on its right
    assert to_ego(ego, np.array([[10.0, 25.0], [7.0, 20.0]])) == pytest.approx(np.array([[5.0, 0.0], [0.0, 3.0]]))


def test_the_points_of_the_future_lie_on_the_driven_track(samples: tuple[Sample, ...]) -> None:
    for sample in samples:
        labels = motion_labels(sample.states, sample.controls)
        places = out_of(sample.here.ego, labels["future"][:, :2].astype(float))
        for k, tick in enumerate(FUTURE_TICKS):
            assert labels["future_ok"][k] == (tick < len(sample.states))
            if labels["future_ok"][k]:
                ego = sample.states[tick].ego
                assert places[k] == pytest.approx([ego.x_m, ego.y_m], abs=1e-3)
                assert labels["future"][k, 3] == pytest.approx(ego.speed_mps, abs=1e-4)
                turned = math.remainder(ego.yaw_rad - sample.here.ego.yaw_rad, math.tau)
                assert labels["future"][k, 2] == pytest.approx(turned, abs=1e-4)


def test_a_drive_that_ends_goes_on_at_its_speed_and_curvature() -> None:
    radius, v = 20.0, 5.0
    rate = v / radius

    def at(tick: int) -> WorldState:
        yaw = rate * tick * 0.05
        ego = EgoState(radius * math.sin(yaw), radius * (1.0 - math.cos(yaw)), yaw, v, 0.0, v * rate, rate, 4.9, 1.8)
        return WorldState(tick, ego, np.zeros((0, 10)), np.zeros(0, dtype=np.int64))

    short = motion_labels([at(tick) for tick in range(8)], [Control(0.1 * k) for k in range(7)])
    whole = motion_labels([at(tick) for tick in range(61)], [Control()] * 60)
    assert short["future"] == pytest.approx(whole["future"], abs=1e-4)
    assert short["future_ok"].tolist() == [True] + [False] * 11
    assert whole["future_ok"].all()
    assert short["controls"][:, 0] == pytest.approx([0.0, 0.6, 0.6, 0.6, 0.6])


def test_controls_are_those_of_now_and_of_every_half_second(samples: tuple[Sample, ...]) -> None:
    sample = next(one for one in samples if len(one.controls) == 60)
    told = motion_labels(sample.states, sample.controls)["controls"]
    wanted = [sample.controls[tick] for tick in (0, 10, 20, 30, 40)]
    assert told == pytest.approx(np.array([(c.throttle, c.steer, c.brake) for c in wanted]), abs=1e-6)


# --- the way ---


def test_the_path_runs_along_the_line_a_metre_at_a_time(samples: tuple[Sample, ...]) -> None:
    for sample in samples[::5]:
        line = sample.here.intent.line
        points = out_of(sample.here.ego, path_ahead(sample.here.ego, line, sample.here.intent.row))
        steps = np.hypot(*np.diff(points, axis=0).T)
        assert steps == pytest.approx(1.0, abs=0.08)  # chords of bends are a little shorter
        for point in points:
            k = int(np.argmin(np.hypot(*(line[:, :2] - point).T)))
            beside = -(point[0] - line[k, 0]) * math.sin(line[k, 2]) + (point[1] - line[k, 1]) * math.cos(line[k, 2])
            assert abs(beside) < 0.06


def test_the_path_goes_on_straight_behind_the_end_of_the_line() -> None:
    line = np.column_stack([np.arange(11.0), np.zeros(11), np.zeros(11)])
    ego = EgoState(5.0, 1.0, 0.0, 3.0, 0.0, 0.0, 0.0, 4.9, 1.8)
    assert path_ahead(ego, line, 5.0) == pytest.approx(np.column_stack([np.arange(1.0, 25.0), np.full(24, -1.0)]))


def test_targets_and_commands_are_those_of_the_planners_of_the_agents(samples: tuple[Sample, ...]) -> None:
    episode = ExpertEpisode.begin(route_of(LIGHT), seed=0)
    planners = [RoutePlanner(episode.simulator.plan(), min_m=m) for m in (MIN_M, MIN_SIMLINGO_M)]
    way = [sample for sample in samples if sample.source == ON_WAY]
    states = {state.tick: state for sample in way for state in sample.states}
    kept = {sample.tick: sample for sample in way}
    seen = set()
    for tick in range(max(kept)):
        targets = (
            [planner.step(states[tick].ego.x_m, states[tick].ego.y_m) for planner in planners] if tick in states else []
        )
        if tick in kept and targets:
            labels = way_labels(kept[tick].here)
            assert labels["command"].tolist() == [int(target.command) for target in targets]
            for k, target in enumerate(targets):
                places = out_of(kept[tick].here.ego, labels["target"][k].astype(float))
                points = [(target.x_m, target.y_m), (target.next_x_m, target.next_y_m)]
                assert places == pytest.approx(np.array(points), abs=1e-3)
            seen.update(labels["command"].tolist())
    assert len(seen) > 1  # a turn was among them


def test_speed_imu_and_pose_are_the_truth(samples: tuple[Sample, ...]) -> None:
    sample = samples[len(samples) // 2]
    labels, ego = way_labels(sample.here), sample.here.ego
    assert labels["speed"] == np.float32(ego.speed_mps)
    assert labels["imu"] == pytest.approx([ego.forward_mps2, ego.right_mps2, ego.yaw_rate_radps], abs=1e-5)
    assert labels["pose"].tolist() == [ego.x_m, ego.y_m, ego.yaw_rad]


# --- gap ---


def test_the_gap_is_that_to_the_car_ahead() -> None:
    gap_m, gap_mps = gap_ahead(first_moment(street(actor(50.0, 0.0, speed_mps=4.0), speed_mps=8.0)))
    assert gap_m == pytest.approx(50.0 - 20.0 - 0.5 * (4.892 + 4.6), abs=0.05)
    assert gap_mps == pytest.approx(4.0)


def test_the_gap_is_that_to_the_line_of_a_red_light_and_nothing_at_a_green_one() -> None:
    red = gap_ahead(first_moment(street(speed_mps=8.0, light=(60.0, LightState.RED))))
    assert 35.0 < red[0] < 60.0 - 20.0 - 0.5 * 4.892
    assert red[1] == 0.0
    assert gap_ahead(first_moment(street(speed_mps=8.0, light=(60.0, LightState.GREEN)))) == (100.0, 8.0)


def test_the_light_in_the_facts_is_the_one_that_the_world_shows(samples: tuple[Sample, ...]) -> None:
    told = set()
    for sample in samples:
        found = dict(zip(FACTS, fact_labels(sample.here).tolist(), strict=True))
        truth, ego = sample.here.truth, sample.here.ego
        if found["light"] == NO_LIGHT:
            continue
        lines = [line for line in truth.lane_map.stop_lines if line.is_light]
        away = [math.hypot(line.x_m - ego.x_m, line.y_m - ego.y_m) - 0.5 * ego.length_m for line in lines]
        near = [line for line, metres in zip(lines, away, strict=True) if abs(metres - found["light_m"]) < 2.5]
        assert any(truth.state.lights[line.index] == found["light"] for line in near)
        told.add(found["light"])
    assert {float(LightState.RED), float(LightState.GREEN)} <= told


def test_at_a_red_light_the_gap_ends_a_little_before_the_line(samples: tuple[Sample, ...]) -> None:
    told = [(gap_ahead(s.here), *fact_labels(s.here)[:2]) for s in samples if s.source == ON_WAY]
    held = [(gap, light_m) for gap, light, light_m in told if light == LightState.RED]
    assert all(gap == pytest.approx((light_m - 0.6, 0.0), abs=1e-3) for gap, light_m in held)
    assert min(light_m for _, light_m in held) < 20.0
