"""The agent `tcp`: which branch drives, what raw GPS does to it, what it forgets; the contract with any weights."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

torch = pytest.importorskip("torch")

from drive_robust_agents._nets.tcp import TcpNet, TcpSpec  # noqa: E402
from drive_robust_agents._vehicle.mkz import Pedals  # noqa: E402
from drive_robust_agents._vehicle.plain_car import pedals_from_plain  # noqa: E402
from drive_robust_agents._wrappers import tuning  # noqa: E402
from drive_robust_agents.tcp import CAMERAS, TCP, Fusion, Mode, joined  # noqa: E402
from drive_robust_agents.training.loop.export import write_weights  # noqa: E402
from drive_robust_agents.training.loop.trainer import TrainingOptions  # noqa: E402
from pytest_drive_robust import Control, GlobalPlan, Observation, RoadOption  # noqa: E402
from pytest_drive_robust.domain.observation import Compass, Gps, Image, Imu, Speed  # noqa: E402
from pytest_drive_robust.domain.route import PlanPoint  # noqa: E402
from pytest_drive_robust.errors import UsageError  # noqa: E402
from pytest_drive_robust.testing import check_agent  # noqa: E402

SMALL = TcpSpec(widths=(8, 16), stem=8, feature=32, state=16, hidden=16)
PLAN = GlobalPlan(tuple(PlanPoint(20.0 * k, 0.0, RoadOption.LANE_FOLLOW) for k in range(5)))
PICTURES = [np.full((96, 160, 3), 10 * k, dtype=np.uint8) for k in range(1, 4)]


class Scripted:
    """A network that says the same to everybody and writes down what it was asked."""

    def __init__(self, *, mps: float = 4.0, action: tuple[float, float] = (0.0, 0.0)) -> None:
        self.asked: list[dict[str, NDArray[Any]]] = []
        self._way, self._action = [(0.5 * mps * k, 0.0) for k in range(1, 5)], action

    def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
        self.asked.append(inputs)
        rows = len(inputs["speed"])
        return {
            "waypoints": np.array([self._way] * rows, dtype=np.float32),
            "action": np.array([self._action] * rows, dtype=np.float32),
        }


def seen(tick: int = 0, *, x_m: float = 0.0, y_m: float = 0.0, speed: float = 4.0, yaw: float = 0.0) -> Observation:
    sensors = (Gps(x_m, y_m, tick), Compass(yaw + math.pi / 2.0, tick), Imu(0.0, 0.0, 0.0, tick), Speed(speed, tick))
    pictures = {camera.name: Image(pixels, tick) for camera, pixels in zip(CAMERAS, PICTURES, strict=True)}
    return Observation(tick, *sensors, pictures)


def driver(network: Scripted, mode: Mode = "traj", **options: Any) -> TCP:
    """An agent behind its first tick, which coasts."""
    agent = TCP(mode, network=network, **options)
    agent.reset(PLAN, 0)
    agent.act(seen())
    return agent


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(0)
    options = TrainingOptions("tcp", 1, 4, 1e-3, 0.0, 1.0)
    return write_weights(TcpNet(SMALL), tmp_path_factory.mktemp("weights"), options=options, step=0)


def test_the_first_tick_coasts() -> None:
    agent = TCP(network=Scripted())
    agent.reset(PLAN, 0)
    assert agent.act(seen(speed=0.0)) == Control()
    assert agent.act(seen(speed=0.0)).throttle > 0.0


def test_the_network_is_given_the_measured_speed_target_and_command() -> None:
    network = Scripted()
    agent = TCP(network=network)
    agent.reset(PLAN, 0)
    agent.act(seen(x_m=2.0, y_m=5.0, speed=7.5))
    asked = network.asked[0]
    assert asked["speed"].tolist() == [7.5]
    assert asked["target"].tolist() == [[18.0, -5.0]]
    assert asked["command"].tolist() == [int(RoadOption.LANE_FOLLOW)]
    assert np.array_equal(asked["image"], joined(PICTURES)[None])


def test_three_pictures_are_joined_from_left_to_right_without_their_edges() -> None:
    columns = [np.arange(160) + shift for shift in (0, 20, 40)]
    pictures = [np.broadcast_to(column[None, :, None], (96, 160, 3)).astype(np.uint8) for column in columns]
    picture = joined(pictures)
    assert [camera.name for camera in CAMERAS] == ["front_left", "front", "front_right"]
    assert picture.shape == (96, 384, 3)
    assert np.array_equal(picture[0, :, 0], np.concatenate([column[16:144] for column in columns]))
    assert np.array_equal(joined([np.stack([one, one]) for one in pictures])[1], picture)


def test_a_wrong_gps_moves_the_target_and_what_it_dropped_does_not_come_back() -> None:
    network = Scripted()
    agent = driver(network)
    for x_m in (0.0, 19.0, 0.0):
        agent.act(seen(x_m=x_m))
    assert [float(asked["target"][0, 0]) for asked in network.asked[1:]] == [20.0, 21.0, 40.0]


def test_reset_forgets_what_was_dropped_and_coasts_again() -> None:
    network = Scripted()
    agent = driver(network)
    agent.act(seen(x_m=19.0))
    agent.reset(PLAN, 1)
    assert agent.act(seen(speed=0.0)) == Control()
    assert float(network.asked[-1]["target"][0, 0]) == 20.0


def test_traj_drives_by_the_waypoints_and_ctrl_by_the_action() -> None:
    braking = (0.5, -0.25)
    assert driver(Scripted(action=braking)).act(seen(speed=3.0)).throttle > 0.0
    assert driver(Scripted(action=braking), "ctrl").act(seen(speed=3.0)).steer == 0.5


@pytest.mark.parametrize("mode", ["traj", "ctrl", "fused"])
def test_by_our_numbers_the_throttle_is_capped_by_the_measured_speed_in_every_mode(mode: Mode) -> None:
    fast = Scripted(mps=12.0, action=(0.0, 1.0))
    for speed, cap in ((5.0, tuning.TCP.cruise_throttle), (1.0, tuning.TCP.free_throttle)):
        given = driver(fast, mode, tuning="ours").act(seen(speed=speed)).throttle
        assert given == pytest.approx(pedals_from_plain(speed, Pedals(cap, 0.0)).throttle)


@pytest.mark.parametrize("mode", ["traj", "ctrl", "fused"])
def test_the_throttle_is_a_twentieth_above_walking_pace_as_published(mode: Mode) -> None:
    fast = Scripted(mps=12.0, action=(0.0, 1.0))
    given = [driver(fast, mode).act(seen(speed=speed)) for speed in (1.4, 1.6)]
    assert [control.throttle for control in given] == pytest.approx([0.5, 0.05])


def test_any_brake_is_a_full_one_as_published_and_what_was_asked_by_our_numbers() -> None:
    braking = Scripted(action=(0.5, -0.25))
    assert driver(braking, "ctrl").act(seen(speed=3.0)) == Control(0.0, 0.5, 1.0)
    assert driver(braking, "ctrl", tuning="ours").act(seen(speed=3.0)) == Control(0.0, 0.5, 0.25)


def test_fused_lets_the_trajectory_lead_on_straights_and_the_control_branch_in_turns() -> None:
    fusion, left, right = Fusion(), Control(steer=-1.0), Control(steer=1.0)
    assert fusion.merge(left, right).steer == pytest.approx(-0.4)
    for _ in range(11):
        fusion.applied(0.2)
    assert fusion.merge(left, right).steer == pytest.approx(0.4)
    for _ in range(10):
        fusion.applied(0.0)
    assert fusion.merge(left, right).steer == pytest.approx(-0.4)


def test_the_plan_is_what_the_network_said_and_the_target() -> None:
    agent = driver(Scripted())
    agent.act(seen())
    assert agent.plan().path == ((2.0, 0.0), (4.0, 0.0), (6.0, 0.0), (8.0, 0.0))
    assert agent.plan().target_points == ((20.0, 0.0),)


def test_agents_of_a_batch_answer_as_they_do_alone() -> None:
    network = Scripted()
    several = [driver(network) for _ in range(4)]
    given = [seen(x_m=5.0 * k, speed=2.0 * k) for k in range(4)]
    together = TCP.act_batch(several, given)
    assert together == [driver(network).act(observation) for observation in given]
    assert len(network.asked[4]["speed"]) == 4


def test_a_compass_that_says_nan_counts_as_zero() -> None:
    network = Scripted()
    agent = driver(network)
    agent.act(replace(seen(), compass=Compass(math.nan, 0)))
    assert network.asked[-1]["target"].tolist() == [[20.0, 0.0]]


def test_it_does_not_act_before_it_has_a_route() -> None:
    with pytest.raises(ValueError, match="no route"):
        TCP(network=Scripted()).act(seen())


def test_an_unknown_mode_is_refused() -> None:
    with pytest.raises(UsageError, match="Known: ctrl, fused, traj"):
        TCP("both", network=Scripted())  # type: ignore[arg-type]


def test_weights_that_are_not_there_are_an_error_and_no_random_driver(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"manifest\.json"):
        TCP(weights=tmp_path / "tcp.safetensors")


@pytest.mark.parametrize("mode", ["traj", "ctrl", "fused"])
def test_it_keeps_the_contract_with_any_weights(mode: Mode, weights: Path) -> None:
    report = check_agent(lambda: TCP(mode, weights=weights))
    assert report.ok, str(report)
    assert {check.name for check in report.checks} >= {"determinism", "reset", "consumes", "lockstep"}
