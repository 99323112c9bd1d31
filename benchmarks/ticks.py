"""Measure ticks per second of the embedded world: bare, with a camera, with perturbations, and as the whole loop.

The reference is `highway-v0`'s own `env.step` at 20 Hz with as many vehicles, in rounds that alternate with ours.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import gymnasium
import highway_env  # noqa: F401 -- registers its ids
import numpy as np
from rich.console import Console
from rich.table import Table

from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, Setting
from pytest_drive_robust.domain.camera_rigs import rig
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import ActorKind, WorldState
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes

CAMERA = CameraSpec("front", width_px=256, height_px=128)
SIX = rig("nuscenes", width_px=160, height_px=96)
EPISODE_TICKS = 600  # 30 s
COUNTED_TICKS = 200  # vehicles are counted, and the bare world is timed, over the first ten seconds
STACK = "3 s burst frame drop and occlusion 0.5 and GPS noise 5 m and speed noise 0.5 and 200 ms latency"
CONTROL = Control(throttle=0.3)


class Idle:
    """An agent that costs nothing."""

    def __init__(self, cameras: tuple[CameraSpec, ...]) -> None:
        self.cameras = cameras

    def sensors(self) -> tuple[CameraSpec, ...]:
        return self.cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Control:
        return CONTROL


def timed(work: Callable[[], int]) -> float:
    """Return ticks per second of one round of process time."""
    start = time.process_time()
    ticks = work()
    return ticks / (time.process_time() - start)


def world(ticks: int) -> Callable[[], int]:
    simulator = EmbeddedSimulator(SimulatorOptions(tick_cap=10**9))

    def work() -> int:
        simulator.reset(ROUTE, seed=0, cameras=())
        world, tick = simulator.world, simulator.world.tick
        start = world.snapshot()
        for number in range(ticks):
            if number % COUNTED_TICKS == 0:
                world.restore(start)  # nobody steers, so later the ego would be far from all traffic
            tick(CONTROL)
        return ticks

    return work


def world_and_cameras(ticks: int, cameras: tuple[CameraSpec, ...]) -> Callable[[], int]:
    simulator = EmbeddedSimulator(SimulatorOptions(tick_cap=10**9))

    def work() -> int:
        simulator.reset(ROUTE, seed=0, cameras=cameras)
        for _ in range(ticks):
            simulator.observe()
            simulator.step(CONTROL)
        return ticks

    return work


def loop(ticks: int, *, cameras: tuple[CameraSpec, ...], setting: str) -> Callable[[], int]:
    simulator = EmbeddedSimulator(SimulatorOptions(tick_cap=ticks))

    def work() -> int:
        result = drive_episode(
            simulator, Idle(cameras), route=ROUTE, setting=Setting.parse(setting), seed=0, agent_name="idle"
        )
        return result.ticks

    return work


def highway(vehicles: int, ticks: int) -> Callable[[], int]:
    env = gymnasium.make(
        "highway-v0",
        config={
            "simulation_frequency": 20,
            "policy_frequency": 20,
            "vehicles_count": vehicles - 1,
            "duration": 10**6,
            "action": {"type": "ContinuousAction"},
        },
    ).unwrapped
    action = np.zeros(2)

    def work() -> int:
        env.reset(seed=0)
        for _ in range(ticks):
            env.step(action)
        return ticks

    return work


def vehicles_on(route: Route) -> float:
    """Return the mean number of vehicles on the road, the ego included, over ten seconds."""
    simulator = EmbeddedSimulator()
    state = simulator.reset(route, seed=0, cameras=())
    counts = []
    for _ in range(COUNTED_TICKS):
        counts.append(1 + int(np.sum(state.actors[:, WorldState.KIND] <= ActorKind.BICYCLE)))
        state = simulator.step(CONTROL)
    return statistics.mean(counts)


def busy_route() -> Route:
    """Return the shipped route that has nearest to twenty vehicles."""
    return min(named_routes("full"), key=lambda route: abs(vehicles_on(route) - 20.0))


ROUTE = busy_route()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    vehicles = round(vehicles_on(ROUTE))
    stack = str(Setting.parse(STACK))
    subjects = {
        "highway-v0 env.step": highway(vehicles, 40),
        "world": world(4000),
        "world, one 256x128 camera": world_and_cameras(400, (CAMERA,)),
        "world, six 160x96 cameras": world_and_cameras(400, SIX),
        "loop around an idle agent": loop(EPISODE_TICKS, cameras=(), setting="clean"),
        "loop, one 256x128 camera": loop(EPISODE_TICKS, cameras=(CAMERA,), setting="clean"),
        "loop, camera, five perturbations": loop(EPISODE_TICKS, cameras=(CAMERA,), setting=stack),
        "loop, one 256x144 camera": loop(EPISODE_TICKS, cameras=(CameraSpec("front"),), setting="clean"),
    }
    for work in subjects.values():
        work()  # compile, fill caches
    rates: dict[str, list[float]] = {name: [] for name in subjects}
    for _ in range(given.rounds):
        for name, work in subjects.items():
            rates[name].append(timed(work))
    title = f"route {ROUTE.label}, {vehicles} vehicles, CPU time"
    table = Table("", "ticks/s", "ms/tick", "30 s of driving", "× highway-env", title=title)
    reference = rates["highway-v0 env.step"]
    for name, measured in rates.items():
        ratio = statistics.median(mine / theirs for mine, theirs in zip(measured, reference, strict=True))
        rate = statistics.median(measured)
        table.add_row(name, f"{rate:,.0f}", f"{1e3 / rate:.3f}", f"{EPISODE_TICKS / rate:.2f} s", f"{ratio:.0f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
