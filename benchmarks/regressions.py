"""Does a comparison with a stored run alarm when it should, and only then? A real agent on the embedded bench.

The agent drives once: that is the stored run. Then it drives again, unchanged, under fresh seeds, and no setting may
alarm. Then it got slower by some milliseconds, and exactly those settings should alarm whose driving score really
drops by more than the 5 % that the default allows: "drop" is the mean over all seeds of a case against the mean over
all seeds of the unchanged agent. Of the first regression, the route that the message names is driven again.

The same command gives the same tables, whatever the number of workers.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "calibration"))

from late_agent import STUCK_STOP_S, LateAgent, snapshot_of_results

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Comparison
from pytest_drive_robust.regression.snapshot import Snapshot
from pytest_drive_robust.report.comparison import comparison_text
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.verdict.explain import describe_outcome

SETTINGS = "clean,100 ms latency,200 ms latency"
ALLOWED = 0.05
DRIVES_AT_ONCE = 4


@dataclass(frozen=True)
class Drive:
    agent: str
    late_ms: int
    route: Route
    setting: str
    seed: int


@cache
def made(agent: str, late_ms: int) -> tuple[Simulator, Agent]:
    """Make one world and one agent object per process and case."""
    import cv2

    cv2.setNumThreads(1)
    registry = default_registry()
    simulator = registry.simulator("embedded", SimulatorOptions(stuck_stop_s=STUCK_STOP_S))
    return simulator, LateAgent(registry.agent(agent), late_ms)


def drive(asked: Drive) -> EpisodeResult:
    simulator, agent = made(asked.agent, asked.late_ms)
    setting = Setting.parse(asked.setting)
    return drive_episode(simulator, agent, route=asked.route, setting=setting, seed=asked.seed, agent_name=asked.agent)


def drive_all(asked: Sequence[Drive], workers: int) -> list[EpisodeResult]:
    """Return every episode's result, in the order of `asked`."""
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    context = multiprocessing.get_context("spawn")
    with Progress(*columns) as progress, ProcessPoolExecutor(workers, mp_context=context) as pool:
        results = pool.map(drive, asked, chunksize=DRIVES_AT_ONCE)
        return list(progress.track(results, total=len(asked), description="episodes"))


def mean_ds(snapshots: Sequence[Snapshot], agent: str, setting: str) -> float:
    return fmean(score.ds for one in snapshots for score in one.cells[agent, setting].routes.values())


def case_rows(
    name: str, agent: str, unchanged: Sequence[Snapshot], driven: Sequence[Snapshot], found: Sequence[Comparison]
) -> list[tuple[str, ...]]:
    """Return one row per setting: the change of the driving score, and the results of the comparisons."""
    rows = []
    for place, cell in enumerate(found[0].cells):
        usual = mean_ds(unchanged, agent, cell.setting)
        drop = 1.0 - mean_ds(driven, agent, cell.setting) / usual
        said = Counter(comparison.cells[place].verdict for comparison in found)
        expected = "alarm" if drop > ALLOWED else "none"
        counts = (str(said[verdict]) for verdict in ("pass", "inconclusive", "fail"))
        rows.append((name if not place else "", cell.setting, f"{drop:+.1%}", expected, *counts))
    return rows


def witness(comparison: Comparison, given: argparse.Namespace, late_ms: int, routes: Sequence[Route]) -> str:
    """Drive the message's route again; return in words whether the outcome is that of the message."""
    regression = comparison.regressions[0]
    flip = next((flip for flip in regression.flips if flip.fails), None)
    if flip is None:
        return f"{regression.setting}: no route flipped"
    route = next(route for route in routes if route.id == flip.after.route_id)
    again = drive(Drive(given.agent, late_ms, route, regression.setting, flip.after.worst_seed))
    shown = describe_outcome(again)
    same = "the same" if shown == flip.after.outcome else f"NOT THE SAME: {shown}"
    return (
        f"{given.agent} + {late_ms} ms under {regression.setting} names {route.id} {flip.after.scenario}: "
        f"was {flip.before.outcome!r}, is {flip.after.outcome!r}; driven again: {same}"
    )


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agent", default="expert")
    parser.add_argument("--routes", default="one-per-scenario")
    parser.add_argument("--settings", default=SETTINGS, help="with commas between them")
    parser.add_argument("--late", default="100,300", metavar="MS", help="how much slower the agent got, case by case")
    parser.add_argument("--fresh", type=int, default=20, help="unchanged drives under fresh seeds")
    parser.add_argument("--planted", type=int, default=3, help="drives of each slower agent")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    return parser.parse_args()


def main() -> None:
    given = parsed()
    routes, settings = resolve_routes(given.routes), given.settings.split(",")
    cases = [(0, given.fresh), *((int(text), given.planted) for text in given.late.split(","))]
    drives = [(0, 0), *((late_ms, seed) for late_ms, count in cases for seed in range(1, count + 1))]
    asked = [
        Drive(given.agent, late_ms, route, setting, seed)
        for late_ms, seed in drives
        for setting in settings
        for route in routes
    ]
    results = drive_all(asked, given.workers)
    size = len(settings) * len(routes)
    snapshots = {
        drive: snapshot_of_results(
            results[k * size : (k + 1) * size],
            spec=given.routes,
            label="stored" if not k else f"seed {drive[1]}",
        )
        for k, drive in enumerate(drives)
    }
    stored = snapshots[0, 0]
    unchanged = [snapshot for (late_ms, _), snapshot in snapshots.items() if not late_ms]
    table = Table("case", "setting", "DS drop", "expected", "pass", "open", "alarms", title="against the stored run")
    told, texts = [], []
    for late_ms, count in cases:
        driven = [snapshots[late_ms, seed] for seed in range(1, count + 1)]
        found = [compare(stored, snapshot) for snapshot in driven]
        name = f"+ {late_ms} ms x {count}" if late_ms else f"unchanged x {count}"
        for row in case_rows(name, given.agent, unchanged, driven, found):
            table.add_row(*row)
        red = [comparison for comparison in found if comparison.regressions]
        if late_ms and red:
            told.append(witness(red[0], given, late_ms, routes))
            texts.append(comparison_text(red[0], colour=False))
    console = Console(width=110)
    console.print(table)
    for line in told:
        console.print(line)
    if texts:
        console.rule("the first message")
        console.print(texts[0], markup=False, highlight=False)


if __name__ == "__main__":
    main()
