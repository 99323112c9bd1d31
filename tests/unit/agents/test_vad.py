"""The compact VAD as an agent: what reaches its network, what it remembers, and that company does not change it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

torch = pytest.importorskip("torch")

from drive_robust_agents._nets.blocks import fold_batch_norm  # noqa: E402
from drive_robust_agents._nets.inference import LoadedNetwork  # noqa: E402
from drive_robust_agents._nets.torch_engine import TorchEngine  # noqa: E402
from drive_robust_agents._nets.vad import VadNet, VadSpec  # noqa: E402
from drive_robust_agents._vehicle.mkz import Pedals  # noqa: E402
from drive_robust_agents._vehicle.plain_car import pedals_from_plain  # noqa: E402
from drive_robust_agents._wrappers.memory import CAN_BUS  # noqa: E402
from drive_robust_agents.training.data.rigs import agent_rig  # noqa: E402
from drive_robust_agents.vad import VAD  # noqa: E402
from pytest_drive_robust import Control, GlobalPlan, Observation, RoadOption  # noqa: E402
from pytest_drive_robust.domain.agent import SIGNALS  # noqa: E402
from pytest_drive_robust.domain.observation import Compass, Gps, Image, Imu, Speed  # noqa: E402
from pytest_drive_robust.domain.route import PlanPoint  # noqa: E402
from pytest_drive_robust.runner.lockstep.check import Recording, check_lockstep  # noqa: E402


def plan(*commands: RoadOption) -> GlobalPlan:
    """Straight to the east, a point every 20 m."""
    return GlobalPlan(tuple(PlanPoint(20.0 * k, 0.0, command) for k, command in enumerate(commands)))


def observed(tick: int, *, x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0, seed: int = 0) -> Observation:
    """Noise in all cameras; the speed is twice the tick, so that it can be told apart from what GPS says."""
    rng = np.random.default_rng((seed, tick))
    cameras = {
        camera.name: Image(rng.integers(0, 256, (camera.height_px, camera.width_px, 3), dtype=np.uint8), tick)
        for camera in VAD.sensors(object.__new__(VAD))
    }
    return Observation(
        tick=tick,
        gps=Gps(x_m, y_m, tick),
        compass=Compass(yaw_rad + np.pi / 2.0, tick),
        imu=Imu(0.3, -0.1, 0.02, tick),
        speed=Speed(2.0 * tick, tick),
        cameras=cameras,
    )


class Spy:
    """A network that plans a straight way of 2 m a step and keeps what it was given; its map is the tick's speed."""

    def __init__(self) -> None:
        self.given: list[Mapping[str, NDArray[Any]]] = []

    def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
        self.given.append(inputs)
        rows = len(inputs["command"])
        way = np.stack([2.0 * np.arange(1.0, 7.0), np.zeros(6)], axis=-1)
        bev = np.ones((rows, 64, 40, 16), dtype=np.float32) * inputs["can_bus"][:, :1, None, None]
        return {"waypoints": np.repeat(way[None], rows, axis=0).astype(np.float32), "bev": bev}


def spied(*commands: RoadOption, **options: Any) -> tuple[VAD, Spy]:
    spy = Spy()
    agent = VAD(network=spy, **options)
    agent.reset(plan(*(commands or [RoadOption.LANE_FOLLOW] * 3)), 0)
    return agent, spy


def test_it_says_that_every_signal_reaches_it() -> None:
    assert VAD.consumes == set(SIGNALS)
    agent, _ = spied()
    assert tuple(agent.sensors()) == agent_rig("vad").cameras == VadSpec().bev.rig()


def test_the_docstring_counts_the_parameters() -> None:
    counted = sum(value.numel() for value in VadNet(VadSpec()).parameters()) / 1e6
    told = re.search(r"([\d.]+) M parameters", str(__import__("sys").modules[VAD.__module__].__doc__))
    assert told is not None
    assert float(told.group(1)) == pytest.approx(counted, abs=0.006)


def test_the_pictures_are_stacked_in_the_order_of_the_rig() -> None:
    agent, spy = spied()
    seen = observed(3)
    agent.act(seen)
    images = spy.given[0]["images"]
    assert images.shape == (1, 6, 96, 160, 3)
    for number, camera in enumerate(agent.sensors()):
        assert np.array_equal(images[0, number], seen.cameras[camera.name].pixels)


def test_the_command_of_the_next_point_picks_the_plan() -> None:
    agent, spy = spied(RoadOption.LANE_FOLLOW, RoadOption.LEFT, RoadOption.RIGHT)
    agent.act(observed(0))
    agent.act(observed(1, x_m=20.0))
    assert [int(given["command"][0]) for given in spy.given] == [RoadOption.LEFT, RoadOption.RIGHT]


def test_the_can_bus_holds_what_was_sensed() -> None:
    agent, spy = spied()
    for tick in range(13):
        agent.act(observed(tick, x_m=10.0 - 0.1 * tick, y_m=0.4 * tick, yaw_rad=np.pi / 2.0))
    told = dict(zip(CAN_BUS, spy.given[12]["can_bus"][0].tolist(), strict=True))
    assert told == pytest.approx(
        {
            "speed": 24.0,
            "yaw rate": 0.02,
            "forward acceleration": 0.3,
            "right acceleration": -0.1,
            "forward movement": 4.0,  # by GPS and compass, whatever the speedometer says
            "movement right": 1.0,
        },
        abs=1e-5,
    )


def test_a_wrong_gps_moves_the_memory_and_a_wrong_speed_does_not() -> None:
    def last_motion(**wrong: Any) -> NDArray[Any]:
        agent, spy = spied()
        for tick in range(11):
            given = observed(tick, x_m=0.5 * tick)
            agent.act(replace(given, **wrong) if tick == 10 else given)
        return spy.given[10]["motion"][0]  # type: ignore[no-any-return]

    assert last_motion() == pytest.approx([5.0, 0.0, 0.0])
    assert last_motion(speed=Speed(0.0, 10)) == pytest.approx([5.0, 0.0, 0.0])
    assert last_motion(gps=Gps(20.0, 3.0, 10)) == pytest.approx([20.0, 3.0, 0.0])
    assert last_motion(compass=Compass(float("nan"), 10)) == pytest.approx([5.0, 0.0, 0.0])


def test_the_network_gets_its_map_of_half_a_second_ago() -> None:
    agent, spy = spied()
    for tick in range(14):
        agent.act(observed(tick))
    assert [float(given["known"][0]) for given in spy.given] == [0.0] * 10 + [1.0] * 4
    assert [float(given["old_bev"][0, 0, 0, 0]) for given in spy.given[9:]] == [0.0, 0.0, 2.0, 4.0, 6.0]


def test_a_reset_forgets_everything() -> None:
    agent, spy = spied()

    def episode() -> list[Control]:
        agent.reset(plan(*[RoadOption.LANE_FOLLOW] * 4), 0)
        return [agent.act(observed(tick, x_m=3.0 * tick, yaw_rad=0.05)) for tick in range(12)]

    first = episode()
    assert agent.plan().path != ()
    again = episode()
    assert first == again
    for before, after in zip(spy.given[:12], spy.given[12:], strict=True):
        for name, value in before.items():
            assert np.array_equal(value, after[name]), name
    agent.reset(plan(RoadOption.LEFT), 0)
    assert agent.plan().path == ()


def test_the_plan_for_overlays_is_the_way_and_the_target() -> None:
    agent, _ = spied()
    agent.act(observed(0))
    told = agent.plan()
    assert told.path == tuple((2.0 * step, 0.0) for step in range(1, 7))
    assert told.target_points == ((20.0, 0.0),)


def test_our_throttle_is_that_of_a_plain_car_the_same_at_every_speed_below_the_wish() -> None:
    agent, _ = spied(tuning="ours")
    for tick, speed_mps in enumerate((0.0, 1.6, 3.0)):
        given = agent.act(replace(observed(tick), speed=Speed(speed_mps, tick))).throttle
        most = pedals_from_plain(speed_mps, Pedals(VAD.tunings["ours"].most_throttle, 0.0)).throttle
        assert given == pytest.approx(most)
    fast = replace(observed(3), speed=Speed(8.0, 3))
    assert agent.act(fast).brake == pytest.approx(pedals_from_plain(8.0, Pedals(0.0, 1.0)).brake)


def test_without_a_route_it_says_what_is_missing() -> None:
    with pytest.raises(ValueError, match="reset"):
        VAD(network=Spy()).act(observed(0))


def real(seed: int = 0) -> LoadedNetwork:
    """An untrained network as it would drive."""
    torch.manual_seed(seed)
    net = fold_batch_norm(VadNet(VadSpec()).eval().requires_grad_(False)).to(memory_format=torch.channels_last)
    return LoadedNetwork(None, TorchEngine(net))  # type: ignore[arg-type]


def test_company_changes_a_control_by_last_bits_at_most_and_never_unseen() -> None:
    network = real()
    drives = [
        Recording(
            plan(*[RoadOption(1 + seed)] * 3),
            0,
            tuple(observed(tick, x_m=0.3 * tick, yaw_rad=0.1 * seed, seed=seed) for tick in range(0, 32, 8)),
        )
        for seed in range(3)
    ]
    problem = check_lockstep(lambda: VAD(network=network), drives, (4, 8))
    assert problem is None or "in other company" in problem  # the last bits of products are up to the processor


def test_driven_alone_or_in_company_it_plans_the_same_way() -> None:
    network = real()
    several, alone = [VAD(network=network) for _ in range(3)], VAD(network=network)
    for agent in (*several, alone):
        agent.reset(plan(*[RoadOption.STRAIGHT] * 3), 0)
    for tick in range(0, 24, 12):
        VAD.act_batch(several, [observed(tick, seed=seed) for seed in (1, 0, 2)])
        alone.act(observed(tick, seed=0))
    np.testing.assert_allclose(several[1].plan().path, alone.plan().path, atol=1e-4)


def test_the_memory_changes_the_plan() -> None:
    network = real()
    ways = []
    for before in (0, 1):
        agent = VAD(network=network)
        agent.reset(plan(*[RoadOption.STRAIGHT] * 3), 0)
        agent.act(observed(0, seed=before))
        agent.act(observed(10, seed=2))
        ways.append(agent.plan().path)
    assert not np.allclose(ways[0], ways[1], atol=1e-6)


def test_a_network_built_from_the_plain_values_of_its_specification_is_the_same() -> None:
    from drive_robust_agents._nets.manifest import plain_spec

    assert VadNet.build(plain_spec(VadSpec(agents=8))).spec == VadSpec(agents=8)
    with pytest.raises(TypeError, match="agentes"):
        VadNet.build(plain_spec(VadSpec()) | {"agentes": 8})


def test_it_has_the_published_throttle_of_the_controller_alone() -> None:
    agent, _ = spied()
    asked = [agent.act(replace(observed(tick), speed=Speed(1.0, tick))).throttle for tick in range(3)]
    assert asked == [0.75] * 3
