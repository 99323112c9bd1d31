"""The agent `classical`: how it answers what it sees, and a few routes as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from painted_roads import LEFT_TURN, STRAIGHT, TYRE, paint, road

from drive_robust_agents._classical.vision import CAMERA
from drive_robust_agents.classical import Classical
from pytest_drive_robust import Compass, Control, GlobalPlan, Gps, Image, Imu, Observation, PlanPoint, Speed
from pytest_drive_robust.metrics.score import is_success
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes


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


def test_it_brakes_for_an_obstacle() -> None:
    image = road()
    paint(image, (11.0, 13.0), (-0.9, 0.9), TYRE)
    assert _act(image, speed_mps=10.0).brake > 0.5
    assert _act(road(), speed_mps=8.0).throttle > 0.2


def test_a_speed_that_reads_low_makes_it_push() -> None:
    assert _act(road(), speed_mps=14.0).throttle < 0.1
    assert _act(road(), speed_mps=2.8).throttle > 0.7


def test_a_red_lamp_stops_it_and_green_lets_it_go() -> None:
    red, green = road(), road()
    red[45:49, 150:154] = (255, 36, 28)
    green[45:49, 150:154] = (40, 255, 90)
    plan = GlobalPlan(LEFT_TURN.points[:1] + tuple(
        PlanPoint(p.x_m - 18.0, p.y_m, p.command) for p in LEFT_TURN.points[1:]
    ))  # fmt: skip
    assert _act(red, speed_mps=6.0, plan=plan).brake > 0.15
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
        agent.act(_observation(road()))


@pytest.mark.parametrize("route_id", ["801", "2501", "3801", "4002", "201", "2903"])
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
