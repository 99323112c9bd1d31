"""What decides what a failure costs a learned agent: one factor of its wrapper changed at a time, the network as it is.

    python benchmarks/ablations.py tcp --settings "200 ms latency (reading=released)" "GPS noise 15 m"
    python benchmarks/ablations.py simlingo --changes raw-gps --routes full
    python benchmarks/ablations.py tcp --base our-numbers --changes ours-but-pedals

Each change (`_variants.py`) is driven clean and under the settings, over the same routes; a setting with a warm-up is
compared with a clean drive that has it, too. RD is 1 - DS / DS clean with Fieller's 95 % interval; *less by* is how
much smaller RD is than that of the base, the agent as it ships or `--base CHANGE`, with the jackknife's interval,
paired by route. What the store has is not driven again. `--write FOLDER` keeps the table as `AGENT.md` and draws it as
`AGENT.svg`, beside the RD of the paper.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING

import _variants
import matplotlib as mpl
import numpy as np
from _paper.published import PUBLISHED
from _paper.published import SETTINGS as PAPER_SETTINGS
from _variants import VARIANTS
from matplotlib.figure import Figure

from drive_robust_agents.training.drives import degradation, drive, summary
from pytest_drive_robust import Setting
from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.whole_file import write_whole

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult

_ENDS = (-0.4, 1.0)
"""The range of RD in the picture; an interval without a lower end is drawn to its lower end."""
SETTINGS = ("GPS noise 15 m", "200 ms latency (reading=released)")


def parsed(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("agent", choices=sorted(VARIANTS), help="whose wrapper is changed")
    parser.add_argument("--changes", nargs="+", metavar="NAME", help="some of them (default: all that there are)")
    parser.add_argument("--base", default="as-shipped", metavar="NAME", help="the change that others are compared with")
    parser.add_argument("--settings", nargs="+", default=list(SETTINGS), metavar="SENTENCE", help="what fails")
    parser.add_argument("--routes", default="one-per-scenario", help="what --drive-routes understands")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (all cores)")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="keep the table and draw it there")
    parser.add_argument("--store", type=Path, default=Path(".drive-robust"), help="where episodes are kept")
    return parser.parse_args(argv)


def less_by(
    shipped: tuple[Sequence[float], Sequence[float]], changed: tuple[Sequence[float], Sequence[float]]
) -> tuple[float, float, float]:
    """Return (difference, low, high): how much smaller RD became; scores are (clean, perturbed) by route."""
    columns = np.array([*shipped, *changed])

    def difference(sums: np.ndarray) -> float:
        clean, perturbed, clean_now, perturbed_now = sums
        return float(perturbed_now / clean_now - perturbed / clean)

    whole, routes = columns.sum(axis=1), columns.shape[1]
    left_out = np.array([difference(whole - columns[:, route]) for route in range(routes)])
    error = float(np.sqrt((routes - 1) / routes * ((left_out - left_out.mean()) ** 2).sum()))
    value, reach = difference(whole), NormalDist().inv_cdf(0.975) * error
    return value, value - reach, value + reach


@dataclass(frozen=True)
class Row:
    """The cost of a setting for an agent with one change. Scores are 0 to 100, shares and RD 0 to 1."""

    setting: str
    change: str
    routes: int
    clean: float
    score: float
    success: float
    rd: float
    interval: tuple[float | None, float | None]
    less: tuple[float, float, float] | None

    @classmethod
    def of(
        cls,
        setting: str,
        change: str,
        pair: tuple[Sequence[EpisodeResult], Sequence[EpisodeResult]],
        base: tuple[Sequence[EpisodeResult], Sequence[EpisodeResult]],
    ) -> Row:
        """Sum up the episodes of a change, (clean, perturbed), and compare them with those of the base."""
        found, lost = summary(pair[1]), degradation(*pair)
        scores = [tuple([driving_score(one) for one in part] for part in each) for each in (base, pair)]
        return cls(
            setting=setting,
            change=change,
            routes=len(pair[0]),
            clean=summary(pair[0])["driving_score"],
            score=found["driving_score"],
            success=found["success_rate"],
            rd=lost["rd"],
            interval=tuple(lost["rd_interval"]),
            less=None if pair is base else less_by(*scores),
        )

    def __str__(self) -> str:
        low, high = ("-" if bound is None else f"{bound:.2f}" for bound in self.interval)
        less = "" if self.less is None else "{:.2f} ({:.2f} to {:.2f})".format(*self.less)
        return (
            f"| {self.setting} | {self.change} | {self.clean:.1f} | {self.score:.1f} | {100.0 * self.success:.0f} "
            f"| {self.rd:.2f} | {low} to {high} | {less} |"
        )


def driven(given: argparse.Namespace) -> list[Row]:
    """Drive the missing episodes; return the rows, setting by setting, each beginning with the base."""
    changes = list(dict.fromkeys([given.base, *(given.changes or VARIANTS[given.agent][1])]))
    settings = [str(Setting.parse(sentence)) for sentence in given.settings]
    baselines = {setting: str(Setting.parse(setting).baseline) for setting in settings}
    # the shipped agent keeps its own name, so that its stored episodes are not driven again
    names = {change: given.agent if change == "as-shipped" else f"variant:{given.agent}/{change}" for change in changes}
    results = drive(
        list(names.values()),
        list(dict.fromkeys([*baselines.values(), *settings])),
        resolve_routes(given.routes),
        workers=given.workers,
        store=given.store,
        plugin=_variants,
    )
    rows = []
    for setting in settings:
        pairs = {change: (results[name, baselines[setting]], results[name, setting]) for change, name in names.items()}
        rows += [Row.of(setting, change, pair, pairs[given.base]) for change, pair in pairs.items()]
    return rows


def table(agent: str, rows: Sequence[Row]) -> str:
    head = [
        f"{rows[0].routes} routes, seed 0.",
        "",
        f"| `{agent}`, setting | change | DS clean | DS | SR % | RD | 95 % | less by, 95 % |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    return "\n".join([*head, *map(str, rows)]) + "\n"


def picture(agent: str, rows: Sequence[Row]) -> str:
    """Draw RD of every row with its interval, and the paper's RD of the setting, as the text of an SVG."""
    settings = list(dict.fromkeys(row.setting for row in rows))
    with mpl.rc_context({"font.size": 10, "svg.hashsalt": "drive-robust"}):
        figure = Figure(figsize=(9.0, 0.9 + 0.27 * len(rows) + 0.35 * len(settings)), layout="constrained")
        parts = [[row for row in rows if row.setting == setting] for setting in settings]
        grid = figure.subplots(
            len(settings), 1, sharex=True, squeeze=False, height_ratios=[len(part) + 1 for part in parts]
        )
        for axes, setting, part in zip(grid[:, 0], settings, parts, strict=True):
            places = range(len(part))
            for place, row in zip(places, part, strict=True):
                low, high = (end if bound is None else bound for bound, end in zip(row.interval, _ENDS, strict=True))
                colour = "#444444" if row.less is None else "#0072B2"
                axes.plot([low, high], [place, place], color=colour, linewidth=2.0, solid_capstyle="butt")
                axes.plot(row.rd, place, "o", color=colour)
            paper = _paper_rd(agent, setting)
            if paper is not None:
                axes.axvline(paper, color="#D55E00", linestyle=":", label="the paper: CARLA, original network")
            axes.axvline(0.0, color="#BBBBBB", linewidth=0.8, zorder=0)
            axes.set_yticks(list(places), [row.change.replace("-", " ") for row in part])
            axes.set(xlim=_ENDS, ylim=(len(part) - 0.4, -0.6))
            axes.set_title(setting, loc="left", fontsize=10)
            axes.spines[["top", "right"]].set_visible(False)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", fontsize=8, frameon=False)
        grid[-1, 0].set_xlabel(f"RD of {agent}, 95 % interval over {rows[0].routes} routes")
        file = io.StringIO()
        figure.savefig(file, format="svg", facecolor="white", metadata={"Date": None})
        return file.getvalue()


def _paper_rd(agent: str, setting: str) -> float | None:
    """Return the paper's RD of the setting; the paper has one value for both readings."""
    words = setting.partition(" (")[0]
    return PUBLISHED[agent][words].rd if words in PAPER_SETTINGS else None


def main(argv: Sequence[str] | None = None) -> None:
    given = parsed(argv)
    rows = driven(given)
    print(table(given.agent, rows), end="")
    if given.write is not None:
        given.write.mkdir(parents=True, exist_ok=True)
        write_whole(given.write / f"{given.agent}.md", table(given.agent, rows))
        write_whole(given.write / f"{given.agent}.svg", picture(given.agent, rows))


if __name__ == "__main__":
    try:
        main()
    except DriveRobustError as error:
        sys.exit(f"error: {error}")
