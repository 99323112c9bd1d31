"""The agent `simlingo`: what it asks its network, what it says, when it creeps, and that it may go in lockstep."""

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

from drive_robust_agents._nets import prompts, words  # noqa: E402
from drive_robust_agents._nets.simlingo import SimLingoNet, SimLingoSpec  # noqa: E402
from drive_robust_agents._vehicle import mkz  # noqa: E402
from drive_robust_agents._wrappers import tuning  # noqa: E402
from drive_robust_agents._wrappers.path_controller import Creep  # noqa: E402
from drive_robust_agents.simlingo import CAMERAS, SimLingo  # noqa: E402
from drive_robust_agents.training.data.rigs import agent_rig  # noqa: E402
from drive_robust_agents.training.loop.export import write_weights  # noqa: E402
from drive_robust_agents.training.loop.trainer import TrainingOptions  # noqa: E402
from pytest_drive_robust import Control, GlobalPlan, Observation, RoadOption  # noqa: E402
from pytest_drive_robust.domain.observation import Compass, Gps, Image, Imu, Speed  # noqa: E402
from pytest_drive_robust.domain.route import PlanPoint  # noqa: E402
from pytest_drive_robust.errors import UsageError  # noqa: E402
from pytest_drive_robust.runner.lockstep.check import Recording, check_lockstep  # noqa: E402

PLAN = GlobalPlan(tuple(PlanPoint(40.0 * k, 0.0, RoadOption.LANE_FOLLOW) for k in range(6)))


class Scripted:
    """A network that drives straight on at 6 m/s, says one sentence, and writes down what it was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, dict[str, NDArray[Any]]]] = []

    def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
        self.asked.append((method, inputs))
        rows = len(inputs["speed"])
        path = np.stack([np.arange(1.0, 21.0), np.zeros(20)], axis=1)
        waypoints = np.stack([1.5 * np.arange(1.0, 11.0), np.zeros(10)], axis=1)
        found = {"path": np.stack([path] * rows), "waypoints": np.stack([waypoints] * rows)}
        if method == "generate":
            found["answer"] = np.array([prompts.answer_row("accelerate because the road is clear")] * rows)
        return found

    def prompt(self, call: int = -1) -> str:
        return words.decode(self.asked[call][1]["prompt"][0].tolist()[1:-1])


def seen(tick: int, *, seed: int = 0, speed: float = 4.0, noise_m: float = 0.0) -> Observation:
    rng = np.random.Generator(np.random.Philox([seed, tick]))
    pixels = rng.integers(0, 256, (CAMERAS[0].height_px, CAMERAS[0].width_px, 3), dtype=np.uint8)
    x, y = rng.normal(0.0, 1.0, 2) * noise_m
    at = Gps(0.05 * speed * tick + float(x), float(y), tick)
    return Observation(
        tick,
        at,
        Compass(np.pi / 2.0, tick),
        Imu(0.0, 0.0, 0.0, tick),
        Speed(speed, tick),
        {"front": Image(pixels, tick)},
    )


def agent(**options: Any) -> tuple[SimLingo, Scripted]:
    network = Scripted()
    made = SimLingo(network=network, **options)
    made.reset(PLAN, 0)
    return made, network


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(0)
    options = TrainingOptions("simlingo", 1, 4, 1e-3, 0.0, 1.0)
    return write_weights(SimLingoNet(SimLingoSpec()), tmp_path_factory.mktemp("weights"), options=options, step=0)


def test_its_cameras_are_those_of_its_training_data() -> None:
    assert agent()[0].sensors() == agent_rig("simlingo").cameras


def test_the_network_is_asked_with_speed_targets_and_the_driving_prompt() -> None:
    driver, network = agent()
    driver.act(seen(0, speed=4.26))
    method, inputs = network.asked[0]
    assert method == "forward"
    assert inputs["image"].shape == (1, 128, 256, 3)
    assert inputs["speed"] == pytest.approx([4.26])
    assert inputs["target"] == pytest.approx(np.array([[[40.0, 0.0], [80.0, 0.0]]]), abs=1e-6)
    assert network.prompt() == "speed 4.3 m/s target <target> <next> predict the waypoints"
    assert driver.said == ""


def test_it_brakes_in_the_first_tick_and_drives_in_the_next() -> None:
    driver, _ = agent()
    assert driver.act(seen(0)) == Control(brake=1.0)
    second = driver.act(seen(1))
    assert second.throttle > 0.0
    assert second.brake == 0.0


def test_it_says_what_it_does_when_asked_to() -> None:
    driver, network = agent(commentary=True)
    driver.act(seen(0))
    assert network.asked[0][0] == "generate"
    assert network.prompt().endswith("what should the ego do next")
    assert driver.said == "accelerate because the road is clear"
    driver.reset(PLAN, 0)
    assert driver.said == ""


@pytest.mark.parametrize(("safety", "mark"), [(False, "<follow>"), (True, "<safety>")])
def test_an_instruction_is_part_of_every_prompt(safety: bool, mark: str) -> None:
    driver, network = agent(instruction="Drive at 8 m/s!", safety=safety)
    for tick in range(2):
        driver.act(seen(tick))
        assert network.prompt().endswith(f"{mark} drive at 8.0 m/s")


def test_an_instruction_that_it_does_not_know_is_refused_at_once() -> None:
    with pytest.raises(UsageError, match="Did you mean 'faster'"):
        agent(instruction="drive fster")
    with pytest.raises(UsageError, match="there is no instruction named 'faster drive'"):
        agent(instruction="faster drive")


def test_safety_without_an_instruction_is_refused() -> None:
    for made in (agent, SimLingo.check):
        with pytest.raises(UsageError, match="safety=true of simlingo is for an instruction"):
            made(safety=True)


def test_noise_of_the_gps_hardly_moves_the_target_points() -> None:
    targets = []
    for noise_m in (0.0, 5.0):
        driver, network = agent()
        for tick in range(120):
            driver.act(seen(tick, noise_m=noise_m))
        targets.append(np.array([inputs["target"][0, 0] for _, inputs in network.asked[40:]]))
    assert np.abs(targets[1] - targets[0]).mean() < 1.5


def test_a_speedometer_that_reads_too_low_holds_the_filtered_position_back() -> None:
    driver, network = agent()
    for tick in range(60):
        driver.act(seen(tick, speed=8.0))
    honest = network.asked[-1][1]["target"][0, 0, 0]
    driver, network = agent()
    for tick in range(60):
        slow = seen(tick, speed=8.0)
        driver.act(Observation(tick, slow.gps, slow.compass, slow.imu, Speed(4.0, tick), slow.cameras))
    assert network.asked[-1][1]["target"][0, 0, 0] > honest + 3.0


def asked_every(ticks: int, **options: str) -> NDArray[Any]:
    """Return the target points, metres forward, that it saw on a straight road at 8 m/s, asked every so many ticks."""
    driver, network = agent(**options)
    throttle, _ = mkz.pedals(8.0, 0.0)
    for tick in range(0, 81, ticks):
        driver.act(seen(tick, speed=8.0))
        driver._last = Control(throttle=throttle)  # what keeps the speed that it sees
    return np.array([inputs["target"][0, 0, 0] for _, inputs in network.asked])


def test_in_every_tick_the_filter_that_knows_the_time_is_the_published_one() -> None:
    published = asked_every(1, position_filter="published")
    assert np.array_equal(asked_every(1, position_filter="elapsed"), published)
    assert np.array_equal(asked_every(1), published)


@pytest.mark.parametrize("ticks", [2, 4, 10])
def test_asked_every_few_ticks_only_the_published_filter_loses_the_vehicle(ticks: int) -> None:
    published, elapsed, none = (asked_every(ticks, position_filter=name) for name in ("published", "elapsed", "none"))
    assert none[-1] == pytest.approx(40.0 - 32.0)
    assert elapsed[-1] == pytest.approx(none[-1], abs=0.5)
    assert published[-1] > none[-1] + 6.0


def test_an_unknown_filter_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(UsageError, match=r"'elapsd'\. Did you mean 'elapsed'"):
        agent(position_filter="elapsd")


def test_it_creeps_after_standing_for_forty_seconds() -> None:
    class Standing(Scripted):
        def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
            return dict(super().run(method, **inputs), waypoints=np.zeros((len(inputs["speed"]), 10, 2)))

    driver = SimLingo(network=Standing())
    driver.reset(PLAN, 0)
    observation = seen(0, speed=0.0)
    controls = [driver.act(observation) for _ in range(Creep.AFTER_TICKS + Creep.FOR_TICKS + 10)]
    creeping = [k for k, control in enumerate(controls) if control.throttle > 0.0]
    assert creeping == list(range(Creep.AFTER_TICKS, len(controls)))
    assert all(controls[k].brake == 0.0 for k in creeping)


def test_its_plan_is_shown() -> None:
    driver, _ = agent()
    driver.act(seen(0))
    shown = driver.plan()
    assert shown.path[:2] == ((1.0, 0.0), (2.0, 0.0))
    assert shown.speed_points[0] == (1.5, 0.0)
    assert np.array(shown.target_points) == pytest.approx(np.array([[40.0, 0.0], [80.0, 0.0]]), abs=1e-6)
    assert (len(shown.path), len(shown.speed_points)) == (20, 10)


def test_without_a_route_it_does_not_drive() -> None:
    with pytest.raises(ValueError, match="expected reset"):
        SimLingo(network=Scripted()).act(seen(0))


def test_real_weights_drive_and_speak(weights: Path) -> None:
    silent, talking = SimLingo(weights=weights), SimLingo(commentary=True, weights=weights)
    for driver in (silent, talking):
        driver.reset(PLAN, 0)
        controls = [driver.act(seen(tick)) for tick in range(3)]
        assert all(control.problem() is None for control in controls)
    assert all(word in words.VOCABULARY for word in talking.said.split())
    assert silent.said == ""


@pytest.mark.parametrize("commentary", [False, True])
def test_it_may_be_driven_in_lockstep_where_the_processor_keeps_rows_apart(weights: Path, commentary: bool) -> None:
    drives = [
        Recording(PLAN, seed, tuple(seen(8 * k, seed=seed, speed=2.0 + seed, noise_m=1.0) for k in range(3)))
        for seed in range(3)
    ]
    problem = check_lockstep(lambda: SimLingo(commentary, weights=weights), drives, widths=(4, 8))
    assert problem is None or "in other company" in problem  # the last bits of products are up to the processor


def test_the_filter_predicts_with_the_world_s_car_or_with_the_published_one() -> None:
    """A compass that says nothing leaves the yaw to the prediction."""
    turned = {}
    for tuned in ("ours", "published"):
        driver, _ = agent(tuning=tuned)
        driver._last = Control(steer=1.0)
        driver._pose(seen(0, speed=4.0))
        blind = replace(seen(1, speed=4.0), compass=Compass(math.nan, 1))
        turned[tuned] = driver._pose(blind).yaw_rad
    assert turned["ours"] == pytest.approx(turned["published"], rel=1e-3)  # but for the acceleration
    assert turned["ours"] != turned["published"]


def test_published_it_steers_by_the_published_gain_and_believes_the_first_waypoints() -> None:
    published = tuning.SIMLINGO_PUBLISHED
    assert (published.look_s, published.look_m) == pytest.approx((0.3512, 0.1915), abs=1e-4)
    assert (published.speed_from, published.speed_to, published.brake_below_mps) == (0, 2, 0.4)
    for name in ("ours", "published"):
        driver, _ = agent(tuning=name)
        numbers = published if name == "published" else tuning.SIMLINGO
        assert driver._controller.tuning == numbers


def test_published_it_creeps_with_what_the_controller_gives_where_that_is_more() -> None:
    driver, _ = agent(tuning="published")
    controls = [driver.act(seen(0, speed=0.0)) for _ in range(Creep.AFTER_TICKS + 3)]
    assert controls[-1].throttle == 1.0
    assert agent()[0].tuning == "published"
