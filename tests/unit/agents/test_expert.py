"""The expert's rooms one by one, and a few routes as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from privileged_scene import LANE_M, actor, observation, street

from drive_robust_agents._planning.forecast import rollouts
from drive_robust_agents._planning.lane_changes import LaneChanges
from drive_robust_agents._planning.lateral import path_of, shift_length_m
from drive_robust_agents._planning.obstacles import nearest_obstacle, ways_around
from drive_robust_agents._planning.projection import leaders, project
from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.tracks import tracks
from drive_robust_agents._planning.traffic import Traffic
from drive_robust_agents.expert import Expert
from pytest_drive_robust import Control, GlobalPlan
from pytest_drive_robust.domain.truth import ActorKind, GroundTruth, LightState
from pytest_drive_robust.metrics.score import is_success
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.routes import named_routes
from pytest_drive_robust.simulators.embedded.world import World

WAITING = np.array([1.2, 0.7, 0.25])


def act(truth: GroundTruth, *, ticks: int = 1) -> Control:
    agent, control = Expert(), Control()
    agent.reset(GlobalPlan(()), 0)
    for tick in range(ticks):
        control = agent.act(observation(truth, tick))
    return control


def seen(truth: GroundTruth) -> tuple[StaticScene, Traffic]:
    scene, traffic = StaticScene(truth), Traffic()
    traffic.update(truth.frame, scene.graph)
    return scene, traffic


def seconds(truth: GroundTruth, *plans: tuple[float, float, float], stop_row: float = math.inf) -> list[float]:
    """Seconds until trouble in the ego's lane for each plan."""
    scene, traffic = seen(truth)
    ego = truth.frame.ego
    path = path_of(scene, np.zeros(scene.count), ego.x_m, ego.y_m, speed_mps=ego.speed_mps)
    found, _ = rollouts(
        path, ego.x_m, ego.speed_mps, scene.size, traffic.forecast[:, :31].copy(), traffic.sizes,
        leaders(path, ego.x_m, traffic.boxes), np.array(plans), scene.limits, scene.boxes, stop_row, WAITING,
        3.0, False,
    )  # fmt: skip
    return list(found)


# --- the forecast ---


def test_a_place_is_found_along_and_beside_a_line() -> None:
    line = street().route
    assert project(line, 0, 200, 42.3, 1.5) == pytest.approx((42.3, 1.5))


def test_cars_are_expected_to_follow_their_lane_and_to_finish_a_lane_change() -> None:
    changing = actor(60.0, 2.0, speed_mps=8.0, yaw_rad=-0.2)
    _, traffic = seen(street(changing))
    assert traffic.forecast[0, 0, :2] == pytest.approx((60.0, 2.0))
    assert traffic.forecast[0, 15, 0] == pytest.approx(60.0 + 8.0 * 3.0, abs=0.5)
    assert traffic.forecast[0, 15, 1] == pytest.approx(0.0, abs=0.05)


def test_walkers_are_expected_to_walk_straight_on() -> None:
    walker = actor(60.0, 5.0, speed_mps=2.0, yaw_rad=-math.pi / 2.0, kind=ActorKind.PEDESTRIAN)
    _, traffic = seen(street(walker))
    assert traffic.forecast[0, 10, :2] == pytest.approx((60.0, 1.0), abs=1e-6)


def test_at_a_fork_traffic_is_expected_where_somebody_was_seen_to_go() -> None:
    fork = np.concatenate([np.column_stack([np.arange(11.0), np.zeros(11), np.zeros(11)]) for _ in range(3)])
    fork[11:22, 0] += 10.0  # straight on
    fork[22:, 0] = 10.0  # to the right
    fork[22:, 1], fork[22:, 2] = np.arange(11.0), math.pi / 2.0
    owner, first = np.repeat(np.arange(3), 11), np.array([0, 11, 22, 33])
    car = np.array([[5.0, 0.0, 0.0, 5.0, 4.6, 1.9, 0.0]])
    for after, ends in ((1, (15.0, 0.0)), (2, (10.0, 5.0))):
        found, _ = tracks(car, np.array([1]), fork, owner, first, np.array([after, -1, -1]), 10)
        assert found[0, 10, :2] == pytest.approx(ends, abs=0.01)


def test_driving_on_into_a_standing_car_is_trouble_and_braking_is_not() -> None:
    truth = street(actor(45.0, 0.0), speed_mps=10.0)
    going_on, braking = seconds(truth, (0.0, 99.0, 0.0), (-4.0, 99.0, -4.0))
    assert going_on == pytest.approx(1.8, abs=0.4)
    assert braking == pytest.approx(6.0)


def test_a_stop_row_is_kept_by_the_front_bumper() -> None:
    assert seconds(street(speed_mps=10.0), (0.0, 99.0, 0.0), stop_row=40.0)[0] == pytest.approx(1.6, abs=0.21)


def test_who_is_ahead_may_brake_hard_and_who_is_behind_brakes_for_the_ego() -> None:
    ahead = street(actor(34.0, 0.0, speed_mps=10.0), speed_mps=10.0)
    behind = street(actor(10.0, 0.0, speed_mps=12.0), speed_mps=10.0)
    assert seconds(ahead, (0.0, 0.4, -3.2))[0] < 6.0
    assert seconds(behind, (0.0, 99.0, 0.0))[0] == pytest.approx(6.0)


# --- where to drive ---


def test_the_way_back_onto_the_lane_starts_where_the_ego_is_and_heads() -> None:
    scene, _ = seen(street())
    path = path_of(scene, np.zeros(scene.count), 20.0, 1.0, speed_mps=8.0, drift=-0.05)
    assert path[20, 1] == pytest.approx(1.0, abs=1e-6)
    assert path[20, 2] == pytest.approx(-0.05, abs=0.03)
    assert np.abs(path[60:, 1]).max() < 1e-6
    assert np.all(np.abs(path[20:, 1]) <= 1.0 + 1e-9)


def test_a_shift_takes_longer_at_speed() -> None:
    assert shift_length_m(12.0, 3.5) > shift_length_m(2.0, 3.5) > shift_length_m(2.0, 1.0)


def test_a_badly_parked_car_is_passed_in_the_lane_as_far_as_that_goes() -> None:
    scene, traffic = seen(street(actor(60.0, 1.7)))
    found = nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0)
    assert found is not None
    assert (found.first_row, found.last_row) == pytest.approx((57.7, 62.3))
    (way,) = ways_around(scene, found, 20.0, 0.0, speed_mps=8.0)
    assert way.hold_m == pytest.approx(1.7 - 0.95 - 0.75 - 0.92, abs=0.01)
    assert way.shift[60] == pytest.approx(way.hold_m, abs=1e-6)
    assert way.shift[int(way.ends_row) + 1] == pytest.approx(0.0, abs=1e-6)


def test_where_there_is_a_lane_the_same_way_the_ego_takes_the_middle_of_it() -> None:
    scene, traffic = seen(street(actor(60.0, 1.0), same_way=True))
    found = nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0)
    assert found is not None
    assert ways_around(scene, found, 20.0, 0.0, speed_mps=8.0)[0].hold_m == pytest.approx(-LANE_M)


def test_a_queue_is_waited_for_and_a_car_that_never_moves_is_passed() -> None:
    truth = street(actor(60.0, 0.0))
    scene, traffic = seen(truth)
    assert nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0) is None
    for _ in range(20 * 15):
        traffic.update(truth.frame, scene.graph)
    assert nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0) is not None


def test_what_stands_near_each_other_is_passed_in_one_go() -> None:
    scene, traffic = seen(street(actor(60.0, 1.2), actor(70.0, 1.0), actor(110.0, 1.2)))
    found = nearest_obstacle(scene, traffic, np.zeros(scene.count), 30.0)
    assert found is not None
    assert (found.first_row, found.last_row, found.left_m) == pytest.approx((57.7, 72.3, 0.05))


def test_an_oncoming_car_is_no_obstacle() -> None:
    scene, traffic = seen(street(actor(60.0, -1.2, speed_mps=2.0, yaw_rad=math.pi)))
    assert nearest_obstacle(scene, traffic, np.zeros(scene.count), 20.0) is None


def test_lane_changes_of_a_route_are_found_with_room_on_both_sides() -> None:
    route = next(route for route in named_routes("full") if route.scenario.type == "MergerIntoSlowTraffic")
    world = World(route, seed=0)
    scene = StaticScene(world.truth(world.frame()))
    (change,) = scene.changes
    assert change.first < change.start < change.end < change.last
    assert abs(change.old[change.start]) < 0.2
    assert abs(change.new[change.end]) < 0.2
    lanes = LaneChanges(scene)
    assert lanes.pending is change
    assert lanes.profile[change.end] == pytest.approx(change.old[change.end])
    assert lanes.candidate(change.start - 80.0, 10.0) is None
    changed = lanes.candidate(float(change.start), 10.0)
    assert changed is not None
    lanes.adopt(changed)
    assert lanes.pending is None
    assert lanes.stop_row() == math.inf


# --- how fast ---


def test_it_stops_for_a_red_light_and_not_for_a_green_one() -> None:
    assert act(street(light=(36.0, LightState.RED), speed_mps=9.0)).brake > 0.2
    assert act(street(light=(36.0, LightState.GREEN), speed_mps=9.0)).brake == 0.0


def test_it_brakes_for_who_is_about_to_walk_into_the_lane() -> None:
    walker = actor(36.0, 3.4, speed_mps=2.0, yaw_rad=-math.pi / 2.0, kind=ActorKind.PEDESTRIAN)
    assert act(street(walker, speed_mps=10.0)).brake > 0.2


def test_it_waits_behind_an_obstacle_while_somebody_comes_and_goes_when_nobody_does() -> None:
    coming = actor(55.0, -LANE_M, speed_mps=10.0, yaw_rad=math.pi)
    waiting = act(street(actor(34.0, 1.0), coming, x_m=22.2))
    going = act(street(actor(34.0, 1.0), x_m=22.2))
    assert waiting.steer == 0.0
    assert waiting.throttle < 0.2
    assert going.steer < -0.1
    assert going.throttle > 0.5


def test_it_leaves_a_parking_space_only_into_a_gap() -> None:
    coming = actor(12.0, 0.0, speed_mps=9.0)
    assert act(street(coming, right_m=2.9)).throttle == 0.0
    assert act(street(right_m=2.9)).throttle > 0.3


def test_without_ground_truth_it_says_what_it_needs() -> None:
    with pytest.raises(ValueError, match="privileged"):
        Expert().act(observation(None))


TYPES = (
    "AccidentTwoWays",
    "EnterActorFlow",
    "HighwayExit",
    "InvadingTurn",
    "ParkingExit",
    "SequentialLaneChange",
    "SignalizedJunctionLeftTurn",
    "YieldToEmergencyVehicle",
)


@pytest.mark.parametrize("scenario", TYPES)
def test_it_drives_a_route_of_each_kind_and_again_the_same_way(scenario: str) -> None:
    route = next(route for route in named_routes("full") if route.scenario.type == scenario)
    simulator, agent = EmbeddedSimulator(SimulatorOptions(stuck_stop_s=60.0)), Expert()
    first, second = (
        drive_episode(simulator, agent, route=route, setting=Setting.CLEAN, seed=0, agent_name="expert")
        for _ in range(2)
    )
    assert is_success(first), (first.end_detail, first.infractions)
    assert first.ticks == second.ticks
