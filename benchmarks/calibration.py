"""How hard the bench is: reference agents over all routes, type by type, and what each deployment failure costs.

Without options: the successes of `expert`, `reactive`, `blind` at six speeds and `constant` on the 220 routes, for
each of the 44 types. The first should succeed nearly everywhere, the second on less than half, the others hardly ever;
a type that all of them or none of them can drive measures nothing, and what `blind` passes says nothing about cameras.

With `--sensitivity AGENT`: that agent clean and under the eleven settings of Bench2Drive-Robust (Tab. 2), with the
degradation of each and its interval, paired by route.

The same command gives the same tables, whatever the number of workers. Episodes come from the store where it has them.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
import uuid
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import fsum
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from pytest_drive_robust.engine.pool import ProcessExecutor
from pytest_drive_robust.engine.worker_setup import Limits, WorkerSetup
from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.metrics.episodes import require_scorable
from pytest_drive_robust.metrics.score import driving_score, is_success
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.runner.scheduler import Scheduler
from pytest_drive_robust.runner.scopes import Scopes
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.stats.intervals import mean_interval, ratio_interval, share_interval
from pytest_drive_robust.store.events import Event, Finished, Reused
from pytest_drive_robust.store.folder import FolderStore
from pytest_drive_robust.store.whole_file import write_whole

BLIND = ",".join(f"blind:speed={mps}" for mps in (1.4, 2, 4, 6, 8, 11))
AGENTS = f"expert,reactive,{BLIND},constant"
PAPER = (
    "1 s burst frame drop",
    "3 s burst frame drop",
    "occlusion 0.5",
    "occlusion 0.8",
    "GPS noise 5 m",
    "GPS noise 15 m",
    "speed noise 0.5",
    "speed noise 0.2",
    "100 ms latency",
    "200 ms latency",
    "500 ms latency",
)
"""The settings of the paper; every family goes from its mildest to its most severe."""


@dataclass(frozen=True)
class Score:
    agent: str
    scenario: str
    route: str
    setting: str
    seed: int
    success: bool
    driving_score: float


@dataclass(frozen=True)
class Report:
    """A report: title, command, column names and rows; the first column is text, all others are numbers."""

    title: str
    notes: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    totals: tuple[tuple[str, ...], ...]

    def print(self) -> None:
        table = Table(title=self.title, box=SIMPLE_HEAD, pad_edge=False)
        for k, column in enumerate(self.columns):
            table.add_column(column, justify="left" if k == 0 else "right", no_wrap=k == 0)
        for row in self.rows:
            table.add_row(*row)
        table.add_section()
        for row in self.totals:
            table.add_row(*row, style="bold")
        Console(width=200).print(table)

    def markdown(self) -> str:
        lines = [f"## {self.title}", "", self.notes, "", f"| {' | '.join(self.columns)} |"]
        lines.append(f"| --- |{' ---: |' * (len(self.columns) - 1)}")
        lines += [f"| {' | '.join(row)} |" for row in self.rows]
        lines += [f"| {' | '.join(f'**{cell}**' if cell else '' for cell in row)} |" for row in self.totals]
        return "\n".join(lines)


class Watch:
    """Shows the progress of the scheduler (see `runner.scheduler.Observer`)."""

    def __init__(self, progress: Progress, total: int) -> None:
        self._progress = progress
        self._bar = progress.add_task("episodes", total=total)

    def __call__(self, event: Event) -> None:
        if isinstance(event, (Finished, Reused)):
            self._progress.advance(self._bar)

    def ticked(self) -> None: ...


def drive_all(given: argparse.Namespace, agents: Sequence[str], settings: Sequence[str]) -> list[Score]:
    """Return every episode's score; stored episodes are not driven again, so an interrupted run continues."""
    chosen = RunOptions(
        routes=given.routes, routes_given=True, seeds=tuple(range(given.seeds)), stuck_stop_s=given.stuck_stop
    )
    registry = default_registry()
    scopes = Scopes(chosen, registry, resolve_routes)
    requests = [
        request
        for agent in agents
        for setting in settings
        for request in scopes.of(MarkerOptions(agent=agent)).need(Setting.parse(setting), clean=False).requests
    ]
    store = FolderStore(given.store, run=uuid.uuid4().hex)
    worker_setup = WorkerSetup(
        python_path=tuple(sys.path),
        folder=os.getcwd(),
        plugins=(),
        simulator=chosen.simulator,
        options=SimulatorOptions(stuck_stop_s=given.stuck_stop),
        preload_agents=tuple(agents),
    )
    executor = ProcessExecutor(lambda: worker_setup, Limits(), slots=given.workers)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns) as progress:
        scheduler = Scheduler(store, executor, Watch(progress, len(requests)))
        try:
            scheduler.ensure(requests)
        finally:
            scheduler.close()
    return [score_of(request, store) for request in requests]


def score_of(request: EpisodeRequest, store: FolderStore) -> Score:
    result = store.get(request.key)
    assert result is not None
    require_scorable([result])
    episode = request.episode
    return Score(
        episode.agent, result.scenario, request.route.id, episode.setting, episode.seed, is_success(result),
        driving_score(result),
    )  # fmt: skip


def by_route(scores: Iterable[Score]) -> tuple[list[float], list[float]]:
    """Return (share of successes, driving score) of each route, means over its seeds, in the order of driving."""
    routes: dict[str, list[Score]] = {}
    for score in scores:
        routes.setdefault(score.route, []).append(score)
    return (
        [fsum(score.success for score in group) / len(group) for group in routes.values()],
        [fsum(score.driving_score for score in group) / len(group) for group in routes.values()],
    )


def calibration(scores: Sequence[Score], agents: Sequence[str], notes: str) -> tuple[Report, Report]:
    """Report routes passed and driving score of every agent on every scenario type, with totals and their intervals."""
    columns = ("scenario", *(agent.replace(":speed=", " ") for agent in agents))
    passed, driven = [], []
    for scenario in sorted({score.scenario for score in scores}):
        of_agent = [[s for s in scores if (s.scenario, s.agent) == (scenario, agent)] for agent in agents]
        passed.append((scenario, *(f"{sum(score.success for score in mine)}/{len(mine)}" for mine in of_agent)))
        driven.append((scenario, *(f"{_mean(by_route(mine)[1]):.1f}" for mine in of_agent)))
    everywhere = [by_route(score for score in scores if score.agent == agent) for agent in agents]
    shares = [share_interval(successes) for successes, _ in everywhere]
    means = [mean_interval(points, bounds=(0.0, 100.0)) for _, points in everywhere]
    return (
        Report(
            "Routes passed", f"{notes} Of the routes of each type, and in all, with Wilson's intervals.",
            columns, tuple(passed),
            (
                ("all [%]", *(f"{100 * _mean(successes):.1f}" for successes, _ in everywhere)),
                ("95 % interval", *(f"{100 * low:.0f}..{100 * high:.0f}" for low, high in shares)),
            ),
        ),
        Report(
            "Driving score", f"{notes} Means of the routes of each type, and of all, with Student's intervals.",
            columns, tuple(driven),
            (
                ("all", *(f"{_mean(points):.1f}" for _, points in everywhere)),
                ("95 % interval", *(f"{low:.0f}..{high:.0f}" for low, high in means)),
            ),
        ),
    )  # fmt: skip


def drawn(passed: Report) -> str:
    """Return an SVG of the number of passed routes by type and agent; equal reports give equal texts."""
    style: dict[Any, Any] = {"font.size": 9, "svg.hashsalt": "drive-robust", "text.color": "#222222"}
    with mpl.rc_context(style):
        figure = Figure(figsize=(8.6, 0.5 + 0.21 * len(passed.rows)), layout="constrained")
        axes = figure.subplots()
        shares = [[float(Fraction(cell)) for cell in row[1:]] for row in passed.rows]
        axes.imshow(shares, cmap="YlGn", vmin=0.0, vmax=1.0, aspect="auto")
        for y, row in enumerate(passed.rows):
            for x, cell in enumerate(row[1:]):
                colour = "white" if shares[y][x] > 0.7 else "#222222"
                axes.text(x, y, cell.partition("/")[0], ha="center", va="center", color=colour)
        totals = [f"{name}\n{share} %" for name, share in zip(passed.columns[1:], passed.totals[0][1:], strict=True)]
        axes.set_xticks(range(len(totals)), totals)
        axes.set_yticks(range(len(passed.rows)), [row[0] for row in passed.rows])
        axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
        axes.spines[:].set_visible(False)
        text = io.StringIO()
        figure.savefig(text, format="svg", facecolor="white", metadata={"Date": None, "Creator": None})
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n"


def sensitivity(scores: Sequence[Score], agent: str, notes: str) -> Report:
    """Report the cost of every setting for one agent: driving score, success rate, RD with its paired interval."""
    _, clean = by_route(score for score in scores if score.setting == "clean")
    rows = []
    for setting in ("clean", *PAPER):
        successes, driven = by_route(score for score in scores if score.setting == setting)
        row = [setting, f"{_mean(driven):.1f}", f"{_mean(successes):.1%}"]
        if setting == "clean":
            row += ["", ""]
        else:
            low, high = ratio_interval(clean, driven)
            row += [f"{1.0 - _mean(driven) / _mean(clean):.3f}", f"{low:.3f}..{high:.3f}"]
        rows.append(tuple(row))
    columns = ("setting", "DS", "SR", "RD", "95 % interval of RD")
    return Report(f"Sensitivity of {agent}", notes, columns, tuple(rows), ())


def _mean(values: Sequence[float]) -> float:
    return fsum(values) / len(values)


def parsed(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--routes", default="full", help="a named set, a route file, or route ids (default: full)")
    parser.add_argument("--agents", default=AGENTS, help=f"names, separated by commas (default: {AGENTS})")
    parser.add_argument("--sensitivity", metavar="AGENT", help="drive this agent clean and under the paper's settings")
    parser.add_argument("--seeds", type=int, default=1, help="how many seeds, from 0 on (default: 1)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument("--stuck-stop", type=float, default=30.0, help="end an episode after standing so long (30 s)")
    parser.add_argument("--store", type=Path, default=Path(".drive-robust"), help="where episodes are kept")
    parser.add_argument(
        "--write", type=Path, metavar="FILE", help="put the tables into this markdown file, a picture beside it"
    )
    return parser.parse_args(argv)


def write(report: Report, path: Path) -> None:
    """Write the report as a section of a file: replace the section with its title, or append it."""
    text = path.read_text(encoding="utf-8") if path.exists() else "# How hard the bench is\n"
    parts = text.rstrip("\n").split("\n## ")
    kept = [parts[0], *(part for part in parts[1:] if part.split("\n", 1)[0] != report.title)]
    body = "\n## ".join(part.rstrip("\n") + "\n" for part in kept)
    write_whole(path, f"{body}\n{report.markdown()}\n")


def main(argv: Sequence[str] | None = None) -> None:
    given = parsed(argv)
    agents = [given.sensitivity] if given.sensitivity else given.agents.split(",")
    settings = ("clean", *PAPER) if given.sensitivity else ("clean",)
    routes = resolve_routes(given.routes)
    scores = drive_all(given, agents, settings)
    notes = f"{len(routes)} routes (`--routes {given.routes}`), {given.seeds} seed(s)."
    reports: tuple[Report, ...]
    if given.sensitivity:
        notes += " RD = 1 - DS / DS clean, Fieller's interval, paired by route."
        reports = (sensitivity(scores, given.sensitivity, notes),)
    else:
        reports = calibration(scores, agents, notes)
    for report in reports:
        report.print()
        if given.write is not None:
            write(report, given.write)
    if given.write is not None and not given.sensitivity:
        write_whole(given.write.with_suffix(".svg"), drawn(reports[0]))


if __name__ == "__main__":
    try:
        main()
    except DriveRobustError as error:
        sys.exit(f"error: {error}")
