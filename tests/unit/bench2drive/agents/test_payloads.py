"""What an agent of the leaderboard is given in each tick, and what becomes of its answer."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from leaderboard_files import AGENT, CAR_AHEAD, observation, truth_with

from pytest_drive_robust.bench2drive.agents.adapter import control_of
from pytest_drive_robust.bench2drive.agents.official_rig import read_rig
from pytest_drive_robust.bench2drive.agents.payloads import Payloads
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.geodesy import to_geodetic, to_metric
from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption
from pytest_drive_robust.registry.registry import Registry

FOLLOW, LEFT, CHANGE = RoadOption.LANE_FOLLOW, RoadOption.LEFT, RoadOption.CHANGE_LANE_LEFT


@pytest.fixture
def agent(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "noisy_agent.py").write_text(AGENT)
    return Registry().agent("leaderboard:noisy_agent.py")


def plan_of(*commands, step_m=1.0):
    dense = tuple(PlanPoint(k * step_m, 0.0, command) for k, command in enumerate(commands))
    return GlobalPlan(dense[:1], dense)


def seen_by(agent, *ticks, seed=0, **moment):
    agent.reset(plan_of(*[FOLLOW] * 100), seed)
    for tick in ticks:
        agent.act(observation(tick, **moment))
    return [data for data, _ in agent._agent.seen]


def test_a_camera_gives_bgra_with_the_number_of_the_current_frame(agent):
    frame, pixels = seen_by(agent, 7)[0]["CAM_FRONT"]
    assert frame == 8  # the picture itself is of tick 0
    assert pixels.shape == (32, 64, 4)
    assert pixels.dtype == np.uint8
    assert pixels[0, 0].tolist() == [0, 0, 200, 255]
    assert pixels[0, -1].tolist() == [100, 0, 0, 255]


def test_gnss_is_where_the_sensor_is_in_degrees_with_half_a_metre_of_noise(agent):
    data = seen_by(agent, *range(400), x_m=100.0, y_m=50.0, yaw_rad=math.pi / 2)
    fixes = np.array([moment["GPS"][1] for moment in data])
    assert fixes.dtype == np.float64
    latitude, longitude = to_geodetic(100.0, 50.0 - 1.4)  # 1.4 m behind, which is north of a car that heads south
    assert np.abs(fixes.mean(axis=0)[:2] - (latitude, longitude)).max() < 1e-6
    assert 4e-6 < fixes[:, 0].std() < 6e-6
    assert 4e-6 < fixes[:, 1].std() < 6e-6
    metres = np.array([to_metric(*fix[:2]) for fix in fixes])
    assert 0.45 < metres[:, 0].std() < 0.67


def test_the_noise_is_the_same_for_the_same_seed_only(agent):
    first, again, other = (seen_by(agent, 5, seed=seed)[0]["GPS"][1].tolist() for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_imu_has_seven_values_and_its_compass_wakes_after_a_few_frames(agent):
    data = [moment["IMU"][1] for moment in seen_by(agent, *range(10), yaw_rad=0.5)]
    assert all(values.shape == (7,) and values.dtype == np.float64 for values in data)
    assert [math.isnan(values[6]) for values in data] == [True] * 3 + [False] * 7
    assert data[5][6] == pytest.approx(0.5 + math.pi / 2)
    assert data[5][:6] == pytest.approx([1.5, -0.5, 9.81, 0.0, 0.0, 0.2], abs=0.08)
    assert not any(math.isnan(number) for number in data[0][:6])


def test_an_imu_that_is_mounted_askew_shows_its_own_axes():
    spec = {"type": "sensor.other.imu", "x": 0, "y": 0, "z": 0, "yaw": 90.0, "id": "IMU"}
    data = Payloads(read_rig([spec], agent="A"), seed=0, route="").of(observation(9))
    values = data["IMU"][1]
    assert values[:2] == pytest.approx([-0.5, -1.5], abs=0.01)
    assert values[6] == pytest.approx(math.pi)


def test_the_speedometer_gives_a_dictionary_and_time_is_that_of_the_game(agent):
    data = seen_by(agent, 0, 1, 2)
    assert data[0]["SPEED"] == (1, {"speed": 6.0})
    assert [time for _, time in agent._agent.seen] == pytest.approx([0.05, 0.1, 0.15])
    assert list(data[0]) == ["CAM_FRONT", "GPS", "IMU", "SPEED"]


def test_the_plan_keeps_changes_of_the_command_lane_changes_and_a_point_every_50_m(agent):
    commands = [FOLLOW] * 120 + [LEFT] * 10 + [FOLLOW] * 5 + [CHANGE] * 2 + [FOLLOW] * 20
    agent.reset(plan_of(*commands), 0)
    official = agent._agent
    kept = [round(transform.location.x) for transform, _ in official._global_plan_world_coord]
    assert kept == [0, 51, 102, 120, 130, 135, 136, 156]
    assert [command.name for _, command in official._global_plan][3:5] == ["LEFT", "LANEFOLLOW"]
    point, command = official._global_plan[1]
    assert to_metric(point["lat"], point["lon"]) == pytest.approx((51.0, 0.0), abs=1e-6)
    assert point["z"] == 0.0
    assert command.value == 4
    assert len(official._plan_gps_HACK) == len(commands)
    assert official._global_plan_world_coord[0][0].rotation.yaw == pytest.approx(0.0)


def test_every_episode_gets_a_new_agent_and_the_last_one_is_destroyed(agent):
    calls = agent._class.calls
    calls.clear()
    agent.reset(plan_of(*[FOLLOW] * 60), 0)
    first = agent._agent
    agent.reset(plan_of(*[FOLLOW] * 60), 1)
    assert agent._agent is not first
    assert [call[0] for call in calls] == ["setup", "destroy", "setup"]
    assert calls[0][2] == 3  # the plan is there before setup


def test_bench2drive_s_switch_adds_a_name_to_save_under(agent, monkeypatch):
    monkeypatch.setenv("IS_BENCH2DRIVE", "True")
    names = []
    for _ in range(2):
        agent.reset(plan_of(*[FOLLOW] * 60), 0)
        names.append(agent._agent.config)
    assert all(name.startswith("+drive_robust_") for name in names)
    assert names[0] != names[1]  # agents make a folder of that name, which must not be there


def test_the_hero_is_where_the_sensors_put_it(agent):
    seen_by(agent, 3, x_m=12.0, y_m=-4.0, yaw_rad=0.0)
    told = agent._agent.get_metric_info()
    assert told["location"] == [12.0, -4.0, 0.0]
    assert told["acceleration"] == pytest.approx([1.5, -0.5, 0.0])
    assert told["angular_velocity"][2] == pytest.approx(math.degrees(0.2))
    assert told["forward_vector"] == pytest.approx([1.0, 0.0, 0.0])


def test_a_vehicle_control_becomes_a_control(agent):
    agent.reset(plan_of(*[FOLLOW] * 60), 0)
    assert agent.act(observation(0)) == Control(0.5, -0.25, 0.0)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"throttle": 1.5, "steer": -3, "brake": -0.1}, Control(1.0, -1.0, 0.0)),
        ({"throttle": np.float32(0.5), "steer": np.float64(0.25), "brake": np.array(0.0)}, Control(0.5, 0.25, 0.0)),
        ({"throttle": 0.7, "steer": 0.1, "brake": 0.0, "hand_brake": True}, Control(0.0, 0.1, 1.0)),
        ({"throttle": 0.7, "steer": 0.1, "brake": 0.0, "gear": 3, "manual_gear_shift": True}, Control(0.7, 0.1, 0.0)),
    ],
)
def test_anything_with_the_fields_is_taken_and_held_within_range(given, expected):
    assert control_of(SimpleNamespace(**given)) == expected


def test_what_is_no_command_is_named():
    with pytest.raises(TypeError, match="run_step returned None of type NoneType whose throttle is None"):
        control_of(None)
    with pytest.raises(ValueError, match="reverse gear"):
        control_of(SimpleNamespace(throttle=0.3, steer=0.0, brake=0.0, reverse=True))
    assert control_of(SimpleNamespace(throttle=math.nan, steer=0.0, brake=0.0)).problem() is not None


def test_agents_with_lidar_or_a_map_are_privileged_and_say_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lidar_agent.py").write_text(AGENT.replace("sensor.speedometer", "sensor.lidar.ray_cast"))
    agent = Registry().agent("leaderboard:lidar_agent.py")
    assert agent.privileged
    assert agent.consumes == {"cameras", "gps", "compass", "imu"}
    points = seen_by(agent, 0, truth=truth_with(CAR_AHEAD))[0]["SPEED"][1]
    assert points.dtype == np.float32
    assert points.shape[1] == 4


def test_an_agent_that_asks_carla_s_world_finds_itself_and_nobody_else(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    provider = "from srunner.scenariomanager.carla_data_provider import CarlaDataProvider\n"
    looks = "self.seen.append((CarlaDataProvider.get_world().get_actors().filter('*vehicle*'), timestamp))"
    text = AGENT.replace("self.seen.append((input_data, timestamp))", looks)
    (tmp_path / "looking_agent.py").write_text(provider + text)
    agent = Registry().agent("leaderboard:looking_agent.py")
    assert not agent.privileged
    (hero,) = seen_by(agent, 0, truth=truth_with(CAR_AHEAD))[0]
    assert hero.attributes["role_name"] == "hero"
