"""The classical agent and its parts: path, road, lane, corridor, signals, and a few routes as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from drive_robust_agents._classical.corridor import Corridor, oncoming
from drive_robust_agents._classical.daylight import NightDetector, lamp_light
from drive_robust_agents._classical.gap import Gap
from drive_robust_agents._classical.lane_tracker import LaneTracker
from drive_robust_agents._classical.overtake import Overtake
from drive_robust_agents._classical.plan_path import PlanPath
from drive_robust_agents._classical.vision import CAMERA, GroundModel, ground_pixels, signals
from drive_robust_agents.classical import Classical
from pytest_drive_robust import Compass, Control, GlobalPlan, Gps, Image, Imu, Observation, PlanPoint, RoadOption, Speed
from pytest_drive_robust.metrics.score import is_success
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.routes import named_routes

ASPHALT, WHITE, TYRE, SKY = (98, 98, 100), (232, 232, 228), (22, 22, 24), (140, 180, 220)
STRAIGHT = GlobalPlan(tuple(PlanPoint(x, 0.0, RoadOption.LANE_FOLLOW) for x in (0.0, 50.0, 100.0)))
LEFT_TURN = GlobalPlan(
    (
        PlanPoint(0.0, 0.0, RoadOption.LANE_FOLLOW),
        PlanPoint(30.0, 0.0, RoadOption.LEFT),
        PlanPoint(42.0, -12.0, RoadOption.LANE_FOLLOW),
        PlanPoint(42.0, -40.0, RoadOption.LANE_FOLLOW),
    )
)
PATH = np.column_stack((np.arange(44.0), np.zeros(44)))


def _road(lane_right_m: float = 0.0) -> NDArray[np.uint8]:
    """A straight grey road with solid white lines 1.75 m beside the middle of a lane."""
    image = np.empty((CAMERA.height_px, CAMERA.width_px, 3), dtype=np.uint8)
    image[: CAMERA.height_px // 2] = SKY
    image[CAMERA.height_px // 2 :] = ASPHALT
    for side in (-1.75, 1.75):
        _paint(image, (4.0, 40.0), (lane_right_m + side - 0.1, lane_right_m + side + 0.1), WHITE)
    return image


def _by_night(image: NDArray[np.uint8], brighter: float = 1.0) -> NDArray[np.uint8]:
    """The same picture in the vehicle's headlamps, below a dark sky."""
    half = CAMERA.height_px // 2
    depth = CAMERA.z_m * CAMERA.width_px / 2.0 / (np.arange(half) + 0.5)
    right = depth[:, None] * (np.arange(CAMERA.width_px) + 0.5 - CAMERA.width_px / 2.0) / (CAMERA.width_px / 2.0)
    light = 0.12 + lamp_light(depth[:, None] + CAMERA.x_m, right)
    dark = image.copy()
    dark[:half] = (9, 12, 34)
    dark[half:] = np.minimum(image[half:] * (brighter * light)[:, :, None], 255.0)
    return dark


def _paint(
    image: NDArray[np.uint8], forward_m: tuple[float, float], right_m: tuple[float, float], colour: tuple[int, int, int]
) -> None:
    """Paint a rectangle of the ground."""
    grid = np.meshgrid(np.arange(*forward_m, 0.02), np.linspace(*right_m, 100), indexing="ij")
    rows, columns = ground_pixels(*grid)
    image[rows, columns] = colour


def _observation(image: NDArray[np.uint8], *, tick: int = 0, speed_mps: float = 0.0, x_m: float = 0.0) -> Observation:
    return Observation(
        tick=tick,
        gps=Gps(x_m, 0.0, tick),
        compass=Compass(math.pi / 2.0, tick),
        imu=Imu(0.0, 0.0, 0.0, tick),
        speed=Speed(speed_mps, tick),
        cameras={CAMERA.name: Image(image, tick)},
    )


def _act(image: NDArray[np.uint8], *, speed_mps: float, plan: GlobalPlan = STRAIGHT, ticks: int = 5) -> Control:
    agent = Classical()
    agent.reset(plan, 0)
    control = Control()
    for tick in range(ticks):
        control = agent.act(_observation(image, tick=tick, speed_mps=speed_mps))
    return control


def test_a_left_turn_becomes_a_quarter_circle() -> None:
    path = PlanPath(LEFT_TURN, 0.0)
    away = np.hypot(path.points[:, 0] - 30.0, path.points[:, 1] + 12.0)
    turning = (path.points[:, 0] > 30.5) & (path.points[:, 1] > -11.5)
    assert turning.sum() > 20
    assert np.allclose(away[turning], 12.0, atol=0.15)


def test_the_path_passes_every_point_of_the_plan() -> None:
    path = PlanPath(LEFT_TURN, 0.0)
    for point in LEFT_TURN.points:
        assert np.hypot(path.points[:, 0] - point.x_m, path.points[:, 1] - point.y_m).min() < 0.3


def test_the_junction_begins_where_the_command_changes() -> None:
    path = PlanPath(LEFT_TURN, 0.0)
    (junction,) = path.junctions
    assert junction.entry_m == pytest.approx(30.0, abs=0.1)
    assert junction.exit_m - junction.entry_m == pytest.approx(12.0 * math.pi / 2.0, abs=0.3)
    assert path.next_junction(20.0) is junction
    assert path.next_junction(junction.exit_m + 1.0) is None


def test_raw_gps_moves_the_place_on_the_path_both_ways() -> None:
    path = PlanPath(STRAIGHT, 0.0)
    assert [path.locate(x, 3.0) for x in (5.0, 12.0, 8.0)] == [5.0, 12.0, 8.0]


def test_a_dark_base_is_found_where_it_stands() -> None:
    image = _road()
    _paint(image, (12.0, 13.5), (-0.9, 0.9), TYRE)
    bases = GroundModel().bases(image)
    in_front = bases[np.abs(bases[:, 1]) < 0.8]
    assert len(in_front) > 5
    assert np.allclose(in_front[:, 0], 12.0, atol=0.8)


def test_markings_and_asphalt_are_free_road() -> None:
    assert len(GroundModel().bases(_road())) == 0


def test_dead_pixels_hide_what_is_behind_them_and_are_no_obstacle() -> None:
    image = _road()
    _paint(image, (12.0, 13.5), (-0.9, 0.9), TYRE)
    image[CAMERA.height_px - 30 :] = 0
    assert len(GroundModel().bases(image)) == 0


def test_it_is_night_when_the_sky_is_dark_whatever_else_is_black() -> None:
    dusk, night, dead = NightDetector(), _by_night(_road()), np.zeros_like(_road())
    assert not dusk.see(dead)
    assert not dusk.see(_road())
    after = NightDetector()
    assert after.see(night)
    assert after.see(dead)


def test_the_headlamps_fade_to_the_sides_and_far_away() -> None:
    forward, right = np.array([1.5, 8.0, 8.0, 8.0, 40.0]), np.array([0.0, 0.0, 2.5, 6.0, 0.0])
    bumper, near, beside, outside, far = lamp_light(forward, right)
    assert bumper == outside == 0.0
    assert near > beside > 0.3
    assert near > 2.0 * far > 0.0


@pytest.mark.parametrize("brighter", [0.8, 1.0, 1.2])
def test_the_edge_of_the_headlamps_is_no_obstacle(brighter: float) -> None:
    ground, image = GroundModel(), _by_night(_road(), brighter)
    found = [len(ground.bases(image)) for _ in range(30)]
    assert found[0] == found[-1] == 0


def test_light_of_a_street_lamp_on_the_road_is_no_obstacle() -> None:
    ground, image = GroundModel(), _by_night(_road())
    rows, columns = ground_pixels(*np.meshgrid(np.arange(9.0, 15.0, 0.02), np.linspace(-4.0, 4.0, 400)))
    lit = image.copy()
    lit[rows, columns] = np.minimum(image[rows, columns] * np.array([1.8, 1.7, 1.5]), 255.0)
    assert all(len(ground.bases(picture)) == 0 for picture in (image, lit, lit, lit, image))


def test_a_dark_base_in_the_headlamps_is_found_where_it_stands() -> None:
    image = _road()
    _paint(image, (12.0, 13.5), (-0.9, 0.9), TYRE)
    bases = GroundModel().bases(_by_night(image))
    in_front = bases[np.abs(bases[:, 1]) < 0.8]
    assert len(in_front) > 5
    assert np.allclose(in_front[:, 0], 12.0, atol=0.8)


def test_lamps_that_come_towards_it_beside_the_headlamps_are_seen() -> None:
    image = _by_night(_road())
    _paint(image, (14.0, 16.5), (-6.2, -5.0), (255, 255, 234))
    assert oncoming(GroundModel().bases(image))


@pytest.mark.parametrize("offset_m", [-0.6, 0.0, 0.5])
def test_the_lane_is_found_between_its_markings(offset_m: float) -> None:
    lane, image = LaneTracker(), _road(offset_m)
    for _ in range(40):
        lane.see(image, np.full(len(lane.FORWARD_M), 98.0))
    assert lane.middle(np.array([8.0]))[0] == pytest.approx(offset_m, abs=0.12)
    assert lane.quality > 0.5


def test_the_lane_moves_with_the_vehicle() -> None:
    lane = LaneTracker()
    lane.forget(1.0, 0.1)
    lane.move(2.0, 0.1)
    assert lane.middle(np.array([0.0, 10.0])) == pytest.approx([1.2, 1.2])


def test_no_markings_no_confidence() -> None:
    lane, image = LaneTracker(), np.full((CAMERA.height_px, CAMERA.width_px, 3), 98, dtype=np.uint8)
    for _ in range(40):
        lane.see(image, np.full(len(lane.FORWARD_M), 98.0))
    assert lane.quality == 0.0


def test_the_corridor_ends_at_what_blocks_it() -> None:
    corridor = Corridor()
    block = np.array([(15.0, -0.5), (15.2, 0.0), (15.0, 0.5)])
    corridor.update(block, PATH, 0.0, may_dodge=True)
    assert corridor.free_m == pytest.approx(15.0, abs=0.3)


def test_the_corridor_forgets_what_it_no_longer_sees() -> None:
    corridor, nothing = Corridor(), np.empty((0, 2))
    corridor.update(np.array([(15.0, -0.5), (15.2, 0.0)]), PATH, 0.0, may_dodge=True)
    corridor.update(nothing, PATH, 0.5, may_dodge=True)
    assert corridor.free_m == pytest.approx(14.7, abs=0.3)
    for _ in range(10):
        corridor.update(nothing, PATH, 0.5, may_dodge=True)
    assert corridor.free_m == math.inf


def test_it_steps_aside_for_something_still_at_the_right_edge() -> None:
    corridor = Corridor()
    parked = np.array([(20.0, right) for right in (0.6, 0.9, 1.2)])
    for _ in range(40):
        corridor.update(parked, PATH, 0.0, may_dodge=True)
    assert corridor.aside_m == pytest.approx(-0.9, abs=0.1)
    assert corridor.free_m == math.inf


def test_it_waits_for_something_that_walks_in_from_the_right() -> None:
    corridor = Corridor()
    for tick in range(8):
        right = 1.6 - 2.0 * 0.05 * tick
        corridor.update(np.array([(12.0, right), (12.0, right + 0.2)]), PATH, 0.0, may_dodge=True)
    assert corridor.free_m == pytest.approx(12.0, abs=0.3)


def test_a_car_in_the_lane_to_the_left_is_oncoming_and_a_post_is_not() -> None:
    assert oncoming(np.array([(12.0, -4.0), (12.0, -3.4), (12.0, -2.8)]))
    assert not oncoming(np.array([(12.0, -3.4), (12.0, -3.3)]))
    assert not oncoming(np.empty((0, 2)))


def test_a_lamp_that_faces_the_camera_counts_and_one_seen_from_the_side_does_not() -> None:
    image = _road()
    image[40:44, 150:154] = (255, 36, 28)
    image[40:46, 200:201] = (255, 36, 28)
    image[30:36, 180:182] = (40, 255, 90)
    seen = signals(image)
    assert (seen.red, seen.green, seen.sign) == (16, 0, 0)


def test_a_stop_sign_is_of_a_darker_red() -> None:
    image = _road()
    image[60:66, 180:186] = (170, 18, 25)
    seen = signals(image)
    assert seen.sign == 36
    assert seen.red == 0


def test_it_brakes_for_an_obstacle() -> None:
    image = _road()
    _paint(image, (11.0, 13.0), (-0.9, 0.9), TYRE)
    assert _act(image, speed_mps=10.0).brake > 0.5
    assert _act(_road(), speed_mps=8.0).throttle > 0.2


def test_a_speed_that_reads_low_makes_it_push() -> None:
    assert _act(_road(), speed_mps=14.0).throttle < 0.1
    assert _act(_road(), speed_mps=2.8).throttle > 0.7


def test_a_red_lamp_stops_it_and_green_lets_it_go() -> None:
    red, green = _road(), _road()
    red[45:49, 150:154] = (255, 36, 28)
    green[45:49, 150:154] = (40, 255, 90)
    plan = GlobalPlan(LEFT_TURN.points[:1] + tuple(
        PlanPoint(p.x_m - 18.0, p.y_m, p.command) for p in LEFT_TURN.points[1:]
    ))  # fmt: skip
    assert _act(red, speed_mps=6.0, plan=plan).brake > 0.3
    assert _act(green, speed_mps=3.0, plan=plan).brake == 0.0


def test_gps_beside_the_path_steers_back() -> None:
    agent = Classical()
    agent.reset(STRAIGHT, 0)
    plain = np.full((CAMERA.height_px, CAMERA.width_px, 3), 98, dtype=np.uint8)
    observation = _observation(plain, speed_mps=5.0)
    left = Observation(
        tick=0, gps=Gps(10.0, -1.0, 0), compass=observation.compass, imu=observation.imu, speed=observation.speed,
        cameras=observation.cameras,
    )  # fmt: skip
    agent.act(observation)
    assert agent.act(left).steer > 0.05
    assert agent.plan().path[0][1] == pytest.approx(1.0, abs=0.05)


def test_an_empty_plan_is_refused() -> None:
    agent = Classical()
    agent.reset(GlobalPlan(()), 0)
    with pytest.raises(ValueError, match="no points"):
        agent.act(_observation(_road()))


def test_it_enters_right_after_somebody_has_driven_past_and_away() -> None:
    gap, image = Gap(), _road()
    seen = [gap.open(np.array([near, near]), image) for near in np.arange(3.0, 20.0, 0.45)]
    assert not any(seen[:20])
    assert seen[-1]


def test_somebody_who_has_just_set_off_has_others_close_behind() -> None:
    gap, image = Gap(), _road()
    assert not any(gap.open(np.array([near, near]), image) for near in np.arange(3.0, 20.0, 0.15))


def test_it_does_not_enter_against_what_comes() -> None:
    gap, image = Gap(), _road()
    assert not any(gap.open(np.array([near, near]), image) for near in np.arange(40.0, 3.0, -0.45))


def test_what_moves_far_ahead_closes_a_lane_that_nobody_was_seen_in() -> None:
    empty, busy = Gap(), Gap()
    still, moving = _road(), _road()
    moving[72:76, 112:118] = TYRE
    free = [empty.open(np.empty(0), still) for _ in range(140)]
    taken = [busy.open(np.empty(0), moving if tick >= 100 else still) for tick in range(140)]
    assert free[-1]
    assert not taken[-1]


_BLOCK = np.array([(8.0, 0.0), (8.0, 0.3)])


def _stand(overtake: Overtake, image: NDArray[np.uint8], points: NDArray[np.float64] = _BLOCK) -> None:
    """Seven seconds behind points (k, 2), metres along the lane and to its right."""
    for _ in range(140):
        overtake.update(image, *points.T, speed_mps=0.0, travelled_m=0.0, allowed=True)


def test_it_goes_around_what_stands_in_its_lane_and_comes_back() -> None:
    overtake = Overtake()
    _stand(overtake, _road())
    assert overtake.passing
    nothing = np.empty(0)
    offsets = []
    for _ in range(70):
        overtake.update(_road(), nothing, nothing, speed_mps=5.0, travelled_m=0.25, allowed=True)
        offsets.append(overtake.offset_m)
    assert min(offsets) < -3.0
    assert offsets[-1] == 0.0
    assert not overtake.passing


def test_it_waits_behind_brake_lamps_and_in_front_of_a_lane_in_use() -> None:
    braking, busy = Overtake(), Overtake()
    image = _road()
    image[80:84, 118:121] = (254, 46, 32)
    _stand(braking, image)
    _stand(busy, _road(), np.concatenate((_BLOCK, [(20.0, -3.5), (20.0, -3.0)])))
    assert not braking.passing
    assert not busy.passing


def test_it_falls_back_when_what_stood_there_drives_off() -> None:
    overtake = Overtake()
    _stand(overtake, _road())
    for tick in range(20):
        ahead = np.full(2, 8.0 + 0.4 * tick)
        overtake.update(_road(), ahead, np.array([0.0, 0.3]), speed_mps=1.0, travelled_m=0.05, allowed=True)
    assert not overtake.passing


@pytest.mark.parametrize("route_id", ["801", "2501", "3801", "4001", "203", "2902"])
def test_it_drives_a_route_of_each_kind_and_again_the_same_way(route_id: str) -> None:
    """A pedestrian, a parked car, a stop sign, a red light, an accident, a parking lane; nothing is kept."""
    route = next(route for route in named_routes("full") if route.id == route_id)
    simulator, agent = EmbeddedSimulator(SimulatorOptions(stuck_stop_s=30.0)), Classical()
    first, second = (
        drive_episode(simulator, agent, route=route, setting=Setting.CLEAN, seed=0, agent_name="classical")
        for _ in range(2)
    )
    assert is_success(first), first.end_detail
    assert first.ticks == second.ticks
