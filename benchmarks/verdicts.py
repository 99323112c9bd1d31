"""How often the verdicts are wrong, how often right, and after how many pairs: the study of `tests/calibration/`.

Wrong verdicts on every shape of scores against their bars, power and pairs by RD, the paper's suite of 44 cells, and
how many bars rules miss that people use instead.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "calibration"))

import study
from score_model import draw_pairs
from wrong_rules import peeking_rule, point_rule

from pytest_drive_robust.stats import gate

DEGRADATIONS = (0.0, 0.05, 0.10, 0.20, 0.25, 0.30, 0.35, 0.40, 0.50, 0.70)
ALL_EPISODES = 48 * 220


def bars_table(bars: list[study.Bar]) -> Table:
    table = Table("bar", "measured", "allowed", "", title="Bars (two Monte-Carlo standard errors allowed)")
    for bar in bars:
        allowed = f"<= {bar.at_most:g}" if bar.at_most < float("inf") else f">= {bar.at_least:g}"
        table.add_row(bar.name, f"{bar.measured:.3f}", allowed, "" if bar.holds else "[red]missed")
    return table


def power_table(studies: int) -> Table:
    table = Table(
        "agent", *(f"{rd:.2f}" for rd in DEGRADATIONS), title="RD <= 0.30, 220 routes: fail / pass / pairs by RD"
    )
    for profile in study.AGENTS:
        cells = []
        for number, rd in enumerate(DEGRADATIONS):
            pairs = draw_pairs(profile, rd, studies=studies, routes=220, seed=9000 + number)
            outcome = study.judge_all(gate, pairs, 0.30, 0.10)
            cells.append(f"{outcome.fails:.2f} / {outcome.passes:.2f} / {outcome.pairs:.0f}")
        table.add_row(profile, *cells)
    return table


def suite_table(studies: int) -> Table:
    cells, episodes = study.paper_suite(gate, studies)
    share = episodes / ALL_EPISODES
    title = f"The paper's suite as RD <= 0.30: {episodes:,.0f} of {ALL_EPISODES:,} episodes ({share:.0%})"
    table = Table("model", "setting", "RD", "fail", "pass", "pairs", title=title)
    for cell in cells:
        found = cell.outcome
        table.add_row(
            cell.model,
            cell.setting,
            f"{cell.rd:.2f}",
            f"{found.fails:.2f}",
            f"{found.passes:.2f}",
            f"{found.pairs:.0f}",
        )
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=1000, help="made-up runs per case")
    parser.add_argument("--seed", type=int, default=1, help="another seed, another study")
    given = parser.parse_args()
    studies, seed = given.studies, given.seed
    console = Console(width=150)
    bars = [
        *study.all_bars(gate, studies, seed=seed),
        *study.mean_bars(studies, seed=seed),
        *study.list_bars(max(1, studies // 3), seed=seed),
        *study.interval_bars(max(1, studies // 5), seed=seed),
    ]
    console.print(bars_table(bars))
    console.print(power_table(studies))
    console.print(suite_table(max(1, studies // 5)))
    console.print(f"bars missed by the gate: {len(study.misses(bars))} of {len(bars)}")
    for name, rule in (("the plain comparison", point_rule), ("a t test peeked at every ten pairs", peeking_rule)):
        missed = study.misses(study.all_bars(rule, max(1, studies // 5), seed=seed))
        console.print(f"bars missed by {name}: {len(missed)}")


if __name__ == "__main__":
    main()
