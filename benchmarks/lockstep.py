"""Measure the gain of lockstep: equal episodes one by one and 4, 8, 16 at once, for nets of several sizes.

Ticks per second of CPU time of the whole loop (embedded world, camera where the net has one, scoring, trace), one
thread, in rounds that alternate. Needs torch for all but the first row.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, Setting
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.runner.driver import EpisodeDriver
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.lockstep.check import check_lockstep, record
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes

CAMERA = CameraSpec("front", width_px=256, height_px=128)
WIDTHS = (4, 8, 16)
EPISODES = 16
TICKS = 60


class NetAgent:
    """Drives straight on at a speed that the net chooses, so that all episodes are equally long."""

    network: Callable[[Any], Any]
    cameras: tuple[CameraSpec, ...] = ()

    def sensors(self) -> tuple[CameraSpec, ...]:
        return self.cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Control:
        return self.act_batch([self], [observation])[0]

    @classmethod
    def act_batch(cls, agents: Sequence[NetAgent], observations: Sequence[Observation]) -> list[Control]:
        if cls.cameras:
            inputs = np.stack([seen.cameras[CAMERA.name].pixels for seen in observations])
        else:
            inputs = np.zeros((len(observations), 64), dtype=np.float32)
            inputs[:, :3] = [
                (seen.gps.x_m / 100.0, seen.gps.y_m / 100.0, seen.speed.mps / 10.0) for seen in observations
            ]
        return [Control(throttle=0.3 + 0.1 * float(row[0])) for row in cls.network(inputs)]


def numpy_mlp() -> type[NetAgent]:
    rng = np.random.default_rng(0)
    first, second = (rng.normal(size=shape).astype(np.float32) / 16.0 for shape in ((64, 256), (256, 4)))
    return agent_class("numpy MLP 64-256-4", lambda inputs: np.tanh(np.tanh(inputs @ first) @ second))


def torch_agents() -> list[type[NetAgent]]:
    try:
        import torch
    except ImportError:
        return []
    torch.set_num_threads(1)
    torch.manual_seed(0)
    nn = torch.nn

    def block(inputs: int, outputs: int) -> Any:
        return nn.Sequential(nn.Conv2d(inputs, outputs, 3, stride=2, padding=1), nn.ReLU())

    mlp = nn.Sequential(nn.Linear(64, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 4), nn.Tanh())
    layer = nn.TransformerEncoderLayer(128, 4, 256, batch_first=True)
    transformer = nn.TransformerEncoder(layer, 3, enable_nested_tensor=False).eval()
    tokens, head = nn.Linear(8, 128), nn.Linear(128, 4)
    blocks = (block(3, 16), block(16, 32), block(32, 64), block(64, 128))
    cnn = nn.Sequential(*blocks, nn.AdaptiveAvgPool2d(1), nn.Flatten(), nn.Linear(128, 4), nn.Tanh()).eval()

    def plain(network: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def forward(inputs: Any) -> Any:
            with torch.inference_mode():
                return network(torch.from_numpy(inputs)).numpy()

        return forward

    def attend(inputs: Any) -> Any:
        return torch.tanh(head(transformer(tokens(inputs.reshape(len(inputs), 8, 8))).mean(dim=1)))

    def look(pixels: Any) -> Any:
        return cnn(pixels.permute(0, 3, 1, 2).float() / 255.0)

    return [
        agent_class("torch MLP 64-256-256-4", plain(mlp)),
        agent_class("torch transformer, 3 layers of 128", plain(attend)),
        agent_class("torch CNN, one 256x128 camera", plain(look), (CAMERA,)),
    ]


def agent_class(name: str, network: Callable[[Any], Any], cameras: tuple[CameraSpec, ...] = ()) -> type[NetAgent]:
    return type(name, (NetAgent,), {"network": staticmethod(network), "cameras": cameras})


def world() -> EmbeddedSimulator:
    return EmbeddedSimulator(SimulatorOptions(tick_cap=TICKS))


def requests() -> list[EpisodeRequest]:
    routes = named_routes("one-per-scenario")[:EPISODES]
    return [EpisodeRequest(Episode("net", route.id, "clean", 0), route, Setting.CLEAN) for route in routes]


def singly(made: type[NetAgent]) -> Callable[[], int]:
    simulator, agent = world(), made()

    def work() -> int:
        return sum(
            drive_episode(
                simulator, agent, route=request.route, setting=request.setting, seed=0, agent_name="net"
            ).ticks
            for request in REQUESTS
        )

    return work


def together(made: type[NetAgent], width: int) -> Callable[[], int]:
    driver = EpisodeDriver(world, lambda name: made())

    def work() -> int:
        requests = iter(REQUESTS)
        driving = driver.drive_batch("net", lambda: next(requests, None), width, check=False)
        return sum(result.ticks for _, result in driving)

    return work


def rate(work: Callable[[], int]) -> float:
    started_s = time.process_time()
    ticks = work()
    return ticks / (time.process_time() - started_s)


REQUESTS = requests()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    table = Table(
        "", "one by one", *(f"{width} at once" for width in WIDTHS), "agree to the bit", title="ticks/s of CPU"
    )
    for made in [numpy_mlp(), *torch_agents()]:
        works = [singly(made), *(together(made, width) for width in WIDTHS)]
        for work in works:
            work()  # compile, make worlds
        rates = [[rate(work) for work in works] for _ in range(rounds)]
        single, *many = (statistics.median(column) for column in zip(*rates, strict=True))
        gains = [statistics.median(row[number] / row[0] for row in rates) for number in range(1, len(works))]
        shown = [f"{value:,.0f} (x{gain:.2f})" for value, gain in zip(many, gains, strict=True)]
        recordings = [
            recording for request in REQUESTS[:2] if (recording := record(world(), made(), request)) is not None
        ]
        table.add_row(made.__name__, f"{single:,.0f}", *shown, "no" if check_lockstep(made, recordings) else "yes")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
