"""What the agents of `drive-robust-agents` cost: time per tick, alone and eight at once, share of an episode, memory.

CPU time on one core, in rounds that alternate between the agents; `expert` and `classical` are there for scale. A
learned agent whose weights do not ship yet is measured with random ones, and its row says so: the time of a network
does not depend on what it learnt.

    ms/tick     `act` alone, one episode at a time; `of episode`: its share of the loop with world and cameras
    torch       the same with `engine="torch"`
    8 at once   `act_batch` of eight agents, per agent
    own MB      private memory of a worker process after three episodes; `all MB`: with what it shares with the others
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.table import Table

from drive_robust_agents._nets.weights import locate
from drive_robust_agents.training import candidates
from drive_robust_agents.training.candidates import candidate_name
from drive_robust_agents.training.loop.export import write_weights
from drive_robust_agents.training.loop.trainer import TrainingOptions
from drive_robust_agents.training.recipes.recipe import RECIPES, recipe_of
from pytest_drive_robust import Control, Observation, Setting
from pytest_drive_robust.domain.agent import Agent, offers_lockstep
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.registry.plugins import plugin_source
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.lockstep.check import Recording, record
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes

SCALE = ("expert", "classical")
ROUTES = named_routes("dev10")[:3]
AT_ONCE = 8
NOTHING = "-"


@dataclass
class Subject:
    """One row of the table. `make(engine=...)` makes an agent; `name` is its registered name."""

    title: str
    name: str
    make: Callable[..., Agent]
    weights: str = NOTHING
    parameters: str = NOTHING
    learned: bool = False
    figures: dict[str, list[float]] = field(default_factory=dict)

    def add(self, figures: Mapping[str, float]) -> None:
        for what, value in figures.items():
            self.figures.setdefault(what, []).append(value)

    def shown(self, what: str, pattern: str) -> str:
        values = self.figures.get(what)
        return pattern.format(statistics.median(values)) if values else NOTHING


class Timed:
    """An agent with a clock around `act`."""

    def __init__(self, agent: Agent) -> None:
        self.agent, self.spent_s, self.calls = agent, 0.0, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.agent, name)

    def act(self, observation: Observation) -> Control:
        start = time.process_time()
        control = self.agent.act(observation)
        self.spent_s += time.process_time() - start
        self.calls += 1
        return control


def subjects(names: Sequence[str], folder: Path) -> list[Subject]:
    made = [_learned(name, folder) if name in RECIPES else _plain(name) for name in names]
    candidates.pytest_drive_robust_register(default_registry())
    return made


def _plain(name: str) -> Subject:
    return Subject(name, name, lambda: default_registry().agent(name))


def _learned(name: str, folder: Path) -> Subject:
    cls: Any = default_registry().entry("agents", name).load()
    file, weights = cls.weights[0], "shipped"
    if not file.is_file():
        options = TrainingOptions(name, steps=1, batch=1, lr=1e-3, weight_decay=0.0, clip=1.0)
        torch.manual_seed(0)
        file = write_weights(recipe_of(name).make(), folder / name, options=options, step=0)
        weights = "random"
    _, entry = locate(name, file)

    def make(**options: str) -> Agent:
        agent: Agent = cls(weights=file, **options)
        return agent

    return Subject(name, candidate_name(name, file), make, weights, f"{entry.parameters / 1e6:.2f} M", learned=True)


def alone(agent: Agent, ticks: int) -> tuple[float, float]:
    """Return (ms a tick, share of the episode) of the agent over a few short episodes."""
    world, timed = EmbeddedSimulator(SimulatorOptions(tick_cap=ticks)), Timed(agent)
    start = time.process_time()
    for route in ROUTES:
        result = drive_episode(world, timed, route=route, setting=Setting.CLEAN, seed=0, agent_name="timed")
        if result.outcome is Outcome.AGENT_ERROR:
            raise SystemExit(result.end_detail)
    whole_s = time.process_time() - start
    return 1e3 * timed.spent_s / timed.calls, timed.spent_s / whole_s


def seen_by(agent: Agent, ticks: int) -> Recording:
    request = EpisodeRequest(Episode("timed", ROUTES[0].id, "clean", 0), ROUTES[0], Setting.CLEAN)
    recording = record(EmbeddedSimulator(SimulatorOptions()), agent, request, count=ticks, every=1)
    assert recording is not None
    return recording


def together(several: Sequence[Any], recording: Recording) -> float:
    """Return milliseconds per tick and agent of a batch of agents with equal observations."""
    for agent in several:
        agent.reset(recording.plan, recording.seed)
    start = time.process_time()
    for seen in recording.observations:
        type(several[0]).act_batch(several, [seen] * len(several))
    return 1e3 * (time.process_time() - start) / len(recording.observations) / len(several)


def memory(subject: Subject, ticks: int) -> tuple[float, float]:
    """Return (private, resident) MB of a worker process after an episode on each route. Linux only."""
    worker_setup = WorkerSetup(
        python_path=tuple(sys.path),
        folder=str(Path.cwd()),
        plugins=(plugin_source(candidates),),
        simulator="embedded",
        options=SimulatorOptions(tick_cap=ticks),
        preload_agents=(subject.name,),
    )
    fork_server = ForkServer(worker_setup)
    supervisor = Supervisor(fork_server, Limits())
    try:
        for route in ROUTES:
            supervisor.drive(EpisodeRequest(Episode(subject.name, route.id, "clean", 0), route, Setting.CLEAN))
        lines = Path(f"/proc/{supervisor.pid}/smaps_rollup").read_text().splitlines()[1:]
    finally:
        supervisor.close()
        fork_server.close()
    sizes = {line.split(":")[0]: int(line.split()[1]) / 1e3 for line in lines}
    return sizes["Private_Clean"] + sizes["Private_Dirty"], sizes["Rss"]


def works(subject: Subject, ticks: int) -> list[Callable[[], Mapping[str, float]]]:
    """Return the functions that measure a subject in every round."""

    def driven(agent: Agent, prefix: str) -> Callable[[], Mapping[str, float]]:
        def work() -> Mapping[str, float]:
            ms, share = alone(agent, ticks)
            return {f"{prefix} ms": ms, f"{prefix} share": share}

        return work

    first = subject.make()
    found = [driven(first, "own")]
    if subject.learned:
        found.append(driven(subject.make(engine="torch"), "torch"))
    if offers_lockstep(first):
        several, recording = [subject.make() for _ in range(AT_ONCE)], seen_by(first, ticks)
        found.append(lambda: {"together ms": together(several, recording)})
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", metavar="AGENT", help=f"{', '.join((*SCALE, *sorted(RECIPES)))}")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--ticks", type=int, default=200, help="of each episode")
    given = parser.parse_args()
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        rows = subjects(given.names or (*SCALE, *sorted(RECIPES)), Path(folder))
        measured = [(row, work) for row in rows for work in works(row, given.ticks)]
        for _, work in measured:
            work()  # compile, load, fill caches
        for _ in range(given.rounds):
            for row, work in measured:
                row.add(work())
        for row in rows:
            row.add(dict(zip(("private", "resident"), memory(row, given.ticks), strict=True)))
    show(rows)


def show(rows: Sequence[Subject]) -> None:
    columns = ("", "weights", "parameters", "ms/tick", "of episode", "torch", f"{AT_ONCE} at once", "own MB", "all MB")
    table = Table(*columns, title="CPU ms of an agent per tick on one core, and MB of a worker that drives it")
    for row in rows:
        table.add_row(
            row.title,
            row.weights,
            row.parameters,
            row.shown("own ms", "{:.2f}"),
            row.shown("own share", "{:.0%}"),
            row.shown("torch ms", "{:.2f}"),
            row.shown("together ms", "{:.2f}"),
            row.shown("private", "{:.0f}"),
            row.shown("resident", "{:.0f}"),
        )
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
