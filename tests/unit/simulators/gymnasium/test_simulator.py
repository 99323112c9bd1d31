"""The world of a gymnasium environment: the environment's own motion, our vehicle, our criteria."""

from __future__ import annotations

import copy
import itertools
import math

import gymnasium
import numpy as np
import pytest
from highway_env.vehicle.kinematics import Vehicle
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.route import RoadOption
from pytest_drive_robust.domain.truth import ActorKind, ActorState, WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.gymnasium import gymnasium_simulator
from pytest_drive_robust.simulators.gymnasium.class_attributes import ClassAttributes
from pytest_drive_robust.simulators.gymnasium.ego import acceleration_and_steering
from pytest_drive_robust.simulators.gymnasium.environments import find_spec, make_environment

CONFIG = {
    "simulation_frequency": 20,
    "policy_frequency": 20,
    "action": {"type": "ContinuousAction", "acceleration_range": [-8.0, 5.0], "steering_range": [-0.9, 0.9]},
}
ACTIONS = [np.array([0.3, 0.02 * math.sin(k / 5.0)]) for k in range(60)]


def made(identifier, **options):
    return gymnasium_simulator(SimulatorOptions(**options), identifier)


def follow(simulator, *, speed_mps=9.0, ticks=1000):
    """Pure pursuit of the route until the end of the episode; the score."""
    for _ in range(ticks):
        if simulator.done is not None:
            break
        truth = simulator.truth()
        ego = truth.state.ego
        row = truth.route[min(truth.progress + max(4, int(ego.speed_mps * 0.6)), len(truth.route) - 1)]
        dx, dy = row[0] - ego.x_m, row[1] - ego.y_m
        ahead = dx * math.cos(ego.yaw_rad) + dy * math.sin(ego.yaw_rad)
        right = -dx * math.sin(ego.yaw_rad) + dy * math.cos(ego.yaw_rad)
        steer = math.atan(2.85 * 2.0 * right / max(ahead**2 + right**2, 1.0)) / 0.61
        push = 0.5 * (speed_mps - ego.speed_mps)
        simulator.step(Control(min(max(push, 0.0), 1.0), min(max(steer, -1.0), 1.0), min(max(-push, 0.0), 1.0)))
    return simulator.score()


def states(env):
    return [(*vehicle.position, vehicle.heading, vehicle.speed) for vehicle in env.unwrapped.road.vehicles]


@pytest.mark.parametrize("identifier", ["highway-fast-v0", "racetrack-v0", "intersection-v1"])
def test_the_motion_is_the_environment_s_own_to_the_bit(identifier):
    """Their vehicle, observation and reward give the same traffic as ours."""
    with ClassAttributes().inside():
        theirs = gymnasium.make(gymnasium.spec(identifier), config=CONFIG, disable_env_checker=True)
        theirs.reset(seed=5)
        expected = [states(theirs), *((theirs.step(action), states(theirs))[1] for action in ACTIONS)]
    with ClassAttributes().inside():
        ours = make_environment(find_spec(identifier), name=identifier)
        ours.reset(seed=5)
        assert [states(ours), *((ours.step(action), states(ours))[1] for action in ACTIONS)] == expected


def test_the_ego_is_predicted_without_a_copy_and_with_the_same_numbers():
    with ClassAttributes().inside():
        env = make_environment(find_spec("roundabout-v0"), name="roundabout-v0")
        env.reset(seed=1)
        env.step(np.array([0.1, 0.2]))
        ego = env.unwrapped.vehicle
        before, times = copy.copy(vars(ego)), np.arange(0.25, 3.0, 0.25)
        positions, headings = ego.predict_trajectory_constant_speed(times)
        expected = Vehicle.predict_trajectory_constant_speed(ego, times)
    assert np.array_equal(positions, expected[0])
    assert headings == expected[1]
    assert all(before[name] is value for name, value in vars(ego).items())


def test_a_brake_is_no_reverse_gear():
    simulator = made("highway-fast-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    speeds = [simulator.step(Control(brake=1.0)).ego.speed_mps for _ in range(120)]
    assert speeds[0] == pytest.approx(25.0 - 8.0 * 0.05)
    assert all(later <= earlier for earlier, later in itertools.pairwise(speeds))
    assert speeds[-1] == 0.0
    simulator.close()


@given(
    throttle=st.floats(0.0, 1.0), steer=st.floats(-1.0, 1.0), brake=st.floats(0.0, 1.0), speed_mps=st.floats(0.0, 40.0)
)
@settings(max_examples=200, deadline=None)
def test_a_control_means_the_curvature_and_the_push_of_the_embedded_car(throttle, steer, brake, speed_mps):
    acceleration, angle = acceleration_and_steering(
        Control(throttle, steer, brake), speed_mps=speed_mps, length_m=5.0, dt_s=0.05
    )
    assert math.tan(angle) / 5.0 == pytest.approx(math.tan(0.61 * steer) / 2.85)
    assert -8.0 <= acceleration <= 5.0
    assert speed_mps + 0.05 * acceleration >= -1e-12
    if brake > 0.0:
        assert acceleration <= 0.0


def test_a_crash_is_one_infraction_and_the_environment_ends_the_episode():
    simulator = made("racetrack-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    score = follow(simulator, speed_mps=14.0)
    assert score.end is End.ENVIRONMENT
    assert score.end_detail.endswith("crashed")
    assert [infraction.kind for infraction in score.infractions] == [InfractionKind.COLLISION_VEHICLE]
    assert score.infractions[0].detail.startswith("hit car at 1")
    assert 0.0 < score.route_completion_pct < 100.0
    simulator.close()


def test_an_obstacle_of_the_road_is_layout():
    simulator = made("merge-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    road = simulator.environment.unwrapped.road
    ego, barrier = simulator.environment.unwrapped.vehicle, road.objects[0]
    road.vehicles[:] = [ego]
    barrier.position = ego.position + np.array([12.0, 0.0])
    state = simulator.step(Control(throttle=0.5))
    assert state.actors[:, WorldState.KIND].tolist() == [ActorKind.BARRIER]
    score = follow(simulator, speed_mps=30.0)
    assert [infraction.kind for infraction in score.infractions] == [InfractionKind.COLLISION_LAYOUT]
    simulator.close()


@pytest.mark.parametrize(("speed_mps", "found"), [(0.0, []), (3.0, [InfractionKind.COLLISION_LAYOUT])])
def test_a_standing_ego_has_hit_nobody(speed_mps, found):
    simulator = made("merge-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    road, ego = simulator.environment.unwrapped.road, simulator.environment.unwrapped.vehicle
    road.vehicles[:], ego.speed = [ego], speed_mps
    simulator.step(Control(brake=1.0 if speed_mps == 0.0 else 0.0))
    road.objects[0].position = ego.position + np.array([2.0, 0.0])
    simulator.step(Control(brake=1.0))
    score = simulator.score()
    assert score.end_detail.endswith("crashed")
    assert [infraction.kind for infraction in score.infractions] == found
    simulator.close()


def test_leaving_the_road_is_outside_the_lanes():
    simulator = made("racetrack-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    while simulator.done is None:
        simulator.step(Control(throttle=0.3, steer=-0.2))
    score = simulator.score()
    assert score.end is End.ENVIRONMENT
    assert score.end_detail.endswith("off the road")
    assert InfractionKind.OUTSIDE_LANES in {infraction.kind for infraction in score.infractions}
    simulator.close()


@pytest.mark.parametrize("identifier", ["intersection-v1", "merge-generic-v0", "two-way-v0"])
def test_who_follows_the_route_arrives(identifier):
    simulator = made(identifier)
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    score = follow(simulator, speed_mps=11.0)
    assert (score.end, score.route_completion_pct) == (End.COMPLETED, 100.0)
    assert score.infractions == ()
    assert len(score.speed_ratios_pct) >= 15
    assert score.junction_passed is (identifier == "intersection-v1")
    simulator.close()


def test_who_does_not_move_is_out_of_time_or_stuck():
    for options, end in (({"tick_cap": 40}, End.TICK_CAP), ({"stuck_stop_s": 1.0}, End.STUCK)):
        simulator = made("roundabout-v0", **options)
        simulator.reset(simulator.routes()[0], seed=0, cameras=[])
        while simulator.done is None:
            simulator.step(Control(brake=1.0))
        assert simulator.score().end is end
        simulator.close()


def test_who_drives_away_has_left_the_route():
    simulator = made("intersection-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    while simulator.done is None:
        simulator.step(Control(throttle=0.6, steer=0.3 if simulator.progress_m < 15.0 else 0.0))
    score = simulator.score()
    assert score.end is End.DEVIATED
    kinds = {infraction.kind for infraction in score.infractions}
    assert {InfractionKind.DEVIATION, InfractionKind.OUTSIDE_LANES} <= kinds
    simulator.close()


def test_the_plan_goes_where_the_environment_sends_its_ego():
    left = made("intersection-v1")
    left.reset(left.routes()[0], seed=0, cameras=[])
    assert [point.command for point in left.plan().points[:3]] == [
        RoadOption.LANE_FOLLOW,
        RoadOption.LEFT,
        RoadOption.LANE_FOLLOW,
    ]
    off = made("exit-v0")
    off.reset(off.routes()[0], seed=0, cameras=[])
    commands = [command for command, _ in itertools.groupby(point.command for point in off.plan().points)]
    assert commands.count(RoadOption.CHANGE_LANE_RIGHT) == 6  # from lane 0 over 5 to the exit lane
    assert RoadOption.CHANGE_LANE_LEFT not in commands
    for simulator in (left, off):
        simulator.close()


@pytest.mark.parametrize("identifier", ["roundabout-v0", "exit-v0", "racetrack-large-v0", "u-turn-v0"])
def test_the_route_is_a_smooth_line_with_a_row_each_metre(identifier):
    simulator = made(identifier)
    simulator.reset(simulator.routes()[1], seed=0, cameras=[])
    route = simulator.truth().route
    steps = np.hypot(*np.diff(route[:, :2], axis=0).T)
    bends = np.abs((np.diff(route[:, 2]) + math.pi) % (2.0 * math.pi) - math.pi)
    assert np.all((steps > 0.8) & (steps < 1.2))
    assert bends.max() < 0.35  # highway-env's roundabout is entered at an angle
    assert np.all(route[:, 3] > 0.0)
    simulator.close()


def test_lanes_have_neighbours_successors_and_junctions():
    simulator = made("intersection-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    lanes = simulator.truth().lane_map.lanes
    junction = [lane for lane in lanes if lane.junction]
    assert len(junction) == 12  # three ways out of each of four arms
    arms = [lane for lane in lanes if not lane.junction and lane.left >= 0]
    assert len(arms) == 8
    assert not any(lane.left_same_way for lane in arms)
    assert all(lanes[after].junction for lane in arms for after in lane.successors)
    simulator.close()
    motorway = made("highway-v0")
    motorway.reset(motorway.routes()[0], seed=0, cameras=[])
    lanes = motorway.truth().lane_map.lanes
    assert [(lane.left, lane.right) for lane in lanes] == [(-1, 1), (0, 2), (1, 3), (2, -1)]
    assert all(lane.right_same_way for lane in lanes[:-1])
    assert max(len(lane.centre) for lane in lanes) < 2500  # of 10 km
    motorway.close()


def test_actors_keep_their_numbers_and_show_their_brakes():
    simulator = made("intersection-v0")
    state = simulator.reset(simulator.routes()[0], seed=0, cameras=[])
    where, braking = {}, 0
    for _ in range(100):
        for row in state.actors:
            number, place = int(row[WorldState.ID]), row[[WorldState.X, WorldState.Y]]
            if number in where:
                assert np.hypot(*(place - where[number])) < 1.5
            where[number] = place
            braking += int(row[WorldState.STATE]) & ActorState.BRAKING
        state = simulator.step(Control(brake=1.0))
    assert braking > 0
    assert len(where) > len(state.actors) - 1  # some left, others came
    simulator.close()


def test_the_camera_sees_the_cars_of_the_environment():
    simulator = made("merge-v0")
    simulator.reset(simulator.routes()[0], seed=0, cameras=[CameraSpec("front", width_px=160, height_px=90)])
    inner = simulator.environment.unwrapped
    pictures = []
    for ahead_m in (14.0, 4000.0):
        for vehicle in inner.road.vehicles:
            if vehicle is not inner.vehicle:
                vehicle.position = inner.vehicle.position + np.array([ahead_m, 0.0])
        simulator.step(Control())
        pictures.append(simulator.observe().cameras["front"].pixels.astype(int))
    inside = np.abs(pictures[0] - pictures[1]).max(axis=2)[45:70, 65:95]
    assert (inside > 25).mean() > 0.3
    simulator.close()


def test_sensors_agree_with_the_motion():
    simulator = made("roundabout-v0")
    states = [simulator.reset(simulator.routes()[0], seed=0, cameras=[])]
    states += [simulator.step(Control(throttle=0.4, steer=-0.3)) for _ in range(6)]
    observation, (before, now) = simulator.observe(), (state.ego for state in states[-2:])
    assert (observation.gps.x_m, observation.gps.y_m, observation.speed.mps) == (now.x_m, now.y_m, now.speed_mps)
    assert math.cos(observation.compass.yaw_rad - now.yaw_rad) == pytest.approx(1.0)
    assert observation.imu.forward_mps2 == pytest.approx((now.speed_mps - before.speed_mps) / 0.05)
    assert observation.imu.yaw_rate_radps == pytest.approx((now.yaw_rad - before.yaw_rad) / 0.05)
    assert observation.imu.yaw_rate_radps < 0.0  # to the left
    simulator.close()


def test_before_the_first_reset_there_is_a_sentence():
    with pytest.raises(SimulationError, match="gymnasium:merge-v0 has no route yet"):
        made("merge-v0").plan()
