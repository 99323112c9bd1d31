"""What the engine costs beside what it drives, and what more cores gain: ratios within one run.

    overhead    everything around the agent per tick with 12 other vehicles, against `highway-v0`'s own step
    framework   our episode loop against a bare one over the same world and agent; worker processes against this one
    recording   what the tracks for replays add to driving an episode and making it bytes
    scaling     40 episodes of `classical`: two worker processes to one, `-n 2` against one, Ray against them (wall)
    cached      `suites/paper` when every episode is stored, against a pytest run of one empty test
    judging     a requirement on 10,000 stored episodes, and the table of them
    startup     what being installed costs a pytest run that does not use it

CPU time where nothing is said; `scaling` takes wall time and wants an otherwise idle machine with two cores.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rich.console import Console
from rich.live import Live
from rich.table import Table

from pytest_drive_robust import Setting, requirement
from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.engine.pool import ProcessExecutor
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.campaign import Campaign
from pytest_drive_robust.runner.episode import loop
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.surroundings import Surroundings
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.inline_executor import InlineExecutor
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.store.events import Event
from pytest_drive_robust.store.folder import FolderStore
from pytest_drive_robust.store.record import encode_episode
from pytest_drive_robust.store.record_files import RecordFiles

AGENT = "classical"
OPTIONS = SimulatorOptions(stuck_stop_s=30.0)
SUITE = Path(__file__).parents[1] / "suites" / "paper"
ASKED = requirement("RD", Setting.parse("200 ms latency")) <= 0.5
FORTY = """
import pytest
from pytest_drive_robust import requirement

SEEDS = [pytest.param(seed, marks=pytest.mark.drive_robust(seeds=[seed])) for seed in range(4)]

@pytest.mark.parametrize("seed", SEEDS)
def test_it(drive, seed):
    drive.check(requirement("DS") >= 1, verdict="point")
"""
Rows = Iterable[tuple[str, str]]


def overhead(rounds: int) -> Rows:
    import ticks

    route = min(named_routes("full"), key=lambda route: abs(ticks.vehicles_on(route) - 13.0))
    ours = EmbeddedSimulator(SimulatorOptions(tick_cap=600))
    idle = ticks.Idle((ticks.CAMERA,))
    stack = Setting.parse(ticks.STACK)

    def loop() -> int:
        return drive_episode(ours, idle, route=route, setting=stack, seed=0, agent_name="idle").ticks

    highway = ticks.highway(13, 40)
    loop(), highway()
    pairs = [(1e3 / ticks.timed(loop), 1e3 / ticks.timed(highway)) for _ in range(rounds)]
    mine, theirs = (statistics.median(side) for side in zip(*pairs, strict=True))
    share = statistics.median(mine / theirs for mine, theirs in pairs)
    return [
        ("world, 256x128 camera, five perturbations, score, trace", f"{mine:.3f} ms a tick"),
        ("highway-v0 step with as many vehicles", f"{theirs:.3f} ms"),
        ("ours / highway-v0", f"{share:.1%}"),
    ]


def framework(rounds: int) -> Rows:
    agent = default_registry().agent(AGENT)
    world = EmbeddedSimulator(OPTIONS)
    routes = named_routes("dev10")[:4]

    def bare(route: Route) -> int:
        return drive_bare(world, agent, route)

    def driven(route: Route) -> int:
        return drive_episode(world, agent, route=route, setting=Setting.CLEAN, seed=0, agent_name=AGENT).ticks

    def cpu_s(drive: Callable[[Route], int], route: Route) -> float:
        start = time.process_time()
        drive(route)
        return time.process_time() - start

    ticks = sum(bare(route) + driven(route) for route in routes) // 2
    pairs = [[(cpu_s(bare, route), cpu_s(driven, route)) for _ in range(2 * rounds)] for route in routes]
    least = [[min(side) for side in zip(*of_route, strict=True)] for of_route in pairs]
    alone, whole = (sum(side) for side in zip(*least, strict=True))
    requests = [_request(route, 0) for route in routes]
    shares = [marginal_cpu_of_workers(requests) / sum(cpu_s(driven, route) for route in routes) for _ in range(rounds)]
    return [
        ("drive_episode / bare loop, the fastest of each", f"{whole / alone:.3f}"),
        ("what that is", f"{(whole - alone) / ticks * 1e6:.0f} us a tick"),
        ("worker process / this process", f"{statistics.median(shares):.3f}"),
    ]


class NoSurroundings(Surroundings):
    """A `Surroundings` that ignores the state of the world."""

    def see(self, state: WorldState) -> None: ...

    def see_plan(self, tick: int, agent: Agent) -> None:
        self.next_plan = 1 << 60

    def tracks(self) -> None:
        return None


def recording(rounds: int) -> Rows:
    agent = default_registry().agent(AGENT)
    world = EmbeddedSimulator(OPTIONS)
    routes = named_routes("dev10")[:4]

    def driven(kind: type[Surroundings]) -> float:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(loop, "Surroundings", kind)
            start = time.process_time()
            for route in routes:
                encode_episode(
                    drive_episode(world, agent, route=route, setting=Setting.CLEAN, seed=0, agent_name=AGENT)
                )
            return time.process_time() - start

    driven(Surroundings)
    pairs = [(driven(Surroundings), driven(NoSurroundings)) for _ in range(2 * rounds)]
    return [("with tracks / without", f"{statistics.median(seen / bare for seen, bare in pairs):.3f}")]


def drive_bare(world: EmbeddedSimulator, agent: Agent, route: Route) -> int:
    """Drive with a loop as a user would write it, without perturbation, trace or check; return the number of ticks."""
    world.reset(route, seed=0, cameras=agent.sensors())
    agent.reset(world.plan(), 0)
    ticks = 0
    while world.done is None:
        world.step(agent.act(world.observe()))
        ticks += 1
    world.score()
    return ticks


def marginal_cpu_of_workers(requests: list[EpisodeRequest]) -> float:
    """Return CPU seconds of these episodes in a worker process that runs already."""
    return (cpu_of_workers(requests * 3) - cpu_of_workers(requests)) / 2


def cpu_of_workers(requests: list[EpisodeRequest]) -> float:
    """Return CPU seconds of the episodes in one worker process, with its start and this process's own share."""
    start = used(resource.RUSAGE_CHILDREN) + used(resource.RUSAGE_SELF)
    drive_all(ProcessExecutor(worker_setup, Limits(), slots=1), requests)
    return used(resource.RUSAGE_CHILDREN) + used(resource.RUSAGE_SELF) - start


def scaling(rounds: int) -> Rows:
    requests = [_request(route, seed) for seed in range(4) for route in named_routes("dev10")]

    def pool(slots: int) -> float:
        return drive_all(ProcessExecutor(worker_setup, Limits(), slots=slots), requests)

    yield "two worker processes / one, 40 episodes", ratio_of([(pool(1), pool(2)) for _ in range(rounds)])
    if importlib.util.find_spec("ray") is not None:
        from pytest_drive_robust.engine.ray.executor import RayExecutor

        def ray() -> float:
            return drive_all(RayExecutor(worker_setup, Limits(), address="local", slots=2), requests)

        ray()
        yield "worker processes / Ray, two each", ratio_of([(pool(2), ray()) for _ in range(rounds)])
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "test_forty.py").write_text(FORTY)
        shared = ("--drive-robust", "--drive-agent", AGENT, "--drive-routes", "dev10", "--drive-store", "off", folder)
        runs = [
            (run_pytest("--drive-workers", "1", *shared)[0], run_pytest("-n", "2", *shared)[0]) for _ in range(rounds)
        ]
    yield "-n 2 / one worker, 40 episodes", ratio_of(runs)


def cached(rounds: int) -> Rows:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "test_nothing.py").write_text("def test_nothing(): pass\n")
        paper = (str(SUITE), "--drive-robust", "--drive-agent", AGENT, "--drive-verdict", "point")
        paper = (*paper, "--drive-store", f"{folder}/store")
        run_pytest(*paper)
        pairs = [(run_pytest(*paper)[1], run_pytest(f"{folder}/test_nothing.py")[1]) for _ in range(rounds)]
    whole, alone = (statistics.median(side) for side in zip(*pairs, strict=True))
    return [
        ("suites/paper from the store", f"{whole:.2f} s"),
        ("one empty test", f"{alone:.2f} s"),
        ("beyond start-up", f"{statistics.median(whole - alone for whole, alone in pairs):.2f} s"),
    ]


def judging(rounds: int) -> Rows:
    routes = named_routes("full")[:50]
    scope = Scope(AGENT, "fifty", routes, tuple(range(100)), "benchmark")
    world, agent = EmbeddedSimulator(OPTIONS), default_registry().agent(AGENT)
    need = scope.need(ASKED.setting, clean=True)
    with tempfile.TemporaryDirectory() as folder:
        files = RecordFiles(Path(folder))
        for requests, setting in ((need.clean, ASKED.setting.baseline), (need.perturbed, ASKED.setting)):
            driven = drive_episode(world, agent, route=routes[0], setting=setting, seed=0, agent_name=AGENT)
            for request in requests:
                path = files.path(request.key)
                path.parent.mkdir(parents=True, exist_ok=True)
                result = dataclasses.replace(driven, episode=request.episode)
                path.write_bytes(encode_episode(result, {"key": request.key}))
        times = [judged(Path(folder), scope) for _ in range(rounds)]
    verdict, table = (statistics.median(side) for side in zip(*times, strict=True))
    return [
        ("10,000 stored episodes: the verdict", f"{verdict:.2f} s"),
        ("and their comfort, for the table", f"{table:.2f} s"),
    ]


def judged(folder: Path, scope: Scope) -> tuple[float, float]:
    """Return CPU seconds of a verdict in a new campaign, and of the additional work of the table."""
    executor = InlineExecutor(default_registry(), simulator="embedded", options=OPTIONS, ticked=lambda: None)
    campaign = Campaign(FolderStore(folder), executor, Silence(), metrics="bench2drive")
    start = time.process_time()
    judgement = campaign.judge(ASKED, scope, VerdictRule(kind="point"), nodeid="")
    decided = time.process_time()
    clean = judgement.verdict.clean
    assert clean is not None
    assert clean.comfort is not None
    assert judgement.verdict.perturbed.comfort is not None
    campaign.scheduler.close()
    return decided - start, time.process_time() - decided


class Silence:
    def __call__(self, event: Event) -> None:
        pass

    def ticked(self) -> None:
        pass

    def idle(self) -> None:
        pass


def startup(rounds: int) -> Rows:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "test_nothing.py").write_text("def test_nothing(): pass\n")
        nothing = (f"{folder}/test_nothing.py", "-p", "no:hypothesispytest", "-p", "no:xdist")
        run_pytest(*nothing)
        pairs = [(run_pytest(*nothing)[1], run_pytest(*nothing, "-p", "no:drive_robust")[1]) for _ in range(5 * rounds)]
    added = statistics.median(1e3 * (ours - without) for ours, without in pairs)
    alone = statistics.median(1e3 * without for _, without in pairs)
    return [("pytest without us", f"{alone:.0f} ms"), ("added by being installed", f"{added:.1f} ms")]


def run_pytest(*arguments: str) -> tuple[float, float]:
    """Return (wall seconds, CPU seconds) of a separate pytest run with cached byte code, for any verdicts."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    start, before = time.perf_counter(), used(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(done.stdout + done.stderr)
    return time.perf_counter() - start, used(resource.RUSAGE_CHILDREN) - before


def used(whose: int) -> float:
    """Return CPU seconds."""
    usage = resource.getrusage(whose)
    return usage.ru_utime + usage.ru_stime


def ratio_of(pairs: list[tuple[float, float]]) -> str:
    return f"{statistics.median(one / other for one, other in pairs):.2f} times as fast"


def worker_setup() -> WorkerSetup:
    return WorkerSetup(tuple(sys.path), os.getcwd(), (), "embedded", OPTIONS, preload_agents=(AGENT,))


def _request(route: Route, seed: int) -> EpisodeRequest:
    return EpisodeRequest(Episode(AGENT, route.id, "clean", seed), route, Setting.CLEAN)


@contextmanager
def _closing(executor: Executor) -> Iterator[Executor]:
    try:
        yield executor
    finally:
        executor.close()


def drive_all(executor: Executor, requests: list[EpisodeRequest]) -> float:
    """Return wall seconds of these episodes by running worker processes: two episodes in each slot come before."""
    with _closing(executor):
        _drive(executor, requests[: 2 * executor.slots])
        start = time.perf_counter()
        _drive(executor, requests)
        return time.perf_counter() - start


def _drive(executor: Executor, requests: list[EpisodeRequest]) -> None:
    for future in [executor.submit(request) for request in requests]:
        future.result()


PARTS: dict[str, Callable[[int], Rows]] = {
    part.__name__: part for part in (overhead, framework, recording, scaling, cached, judging, startup)
}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    unknown = [name for name in given.parts if name not in PARTS]
    if unknown:
        parser.error(f"{unknown[0]!r} is no part, expected {', '.join(PARTS)}")
    table = Table("", "", "", title="The engine, CPU time where nothing is said", show_header=False)
    with Live(table, console=Console(width=100), auto_refresh=False) as shown:
        for name in given.parts or PARTS:
            for number, (what, figure) in enumerate(PARTS[name](given.rounds)):
                table.add_row(name if number == 0 else "", what, figure)
                shown.refresh()


if __name__ == "__main__":
    main()
