"""What the pages say of the committed table of the paper is what `results.json` holds."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from _paper.agreement import agreement
from _paper.estimates import Means, degradation, driving_score, efficiency, rd_means
from _paper.joining import read
from _paper.published import AGENTS, AVERAGES, CLEAN, PUBLISHED, SETTINGS
from _paper.readings import READINGS, SAME, Drives
from _paper.results import Results, Scores, SeedScores

from pytest_drive_robust.stats.intervals import mean_interval
from pytest_drive_robust.stats.quantiles import normal_quantile

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
AGENTS_PAGE = BENCHMARKS.parent / "docs" / "gallery" / "agents.md"
PAGE = (BENCHMARKS / "paper" / "README.md").read_text(encoding="utf-8")
SENTENCES = " ".join(PAGE.split())  # wherever their lines end
TWO_SECONDS = "0 ms latency (mode=hold, warmup_ticks=40)"
COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def part(results: Results, kept: Callable[[str], bool]) -> Results:
    """Return what was driven on some of the routes; comfort, which is of no single route, stays that of all."""
    places = [place for place, route in enumerate(results.routes) if kept(route)]

    def of(one: SeedScores) -> SeedScores:
        columns = (one.driving_score, one.success, one.efficiency)
        return SeedScores(*(tuple(column[place] for place in places) for column in columns), one.comfort)

    agents = {
        name: replace(
            driven,
            settings={setting: Scores(tuple(map(of, scores.of_seeds))) for setting, scores in driven.settings.items()},
        )
        for name, driven in results.agents.items()
    }
    routes = {route: facts for route, facts in results.routes.items() if kept(route)}
    return replace(results, routes=routes, agents=agents)


@pytest.fixture(scope="module")
def results() -> Results:
    return read([BENCHMARKS / "paper" / "results.json"])


@pytest.fixture(scope="module")
def parts(results: Results) -> Sequence[Results]:
    """The first route of each type, the second ones, and so on."""
    numbers = sorted({int(route) % 100 for route in results.routes})
    return [part(results, lambda route, number=number: int(route) % 100 == number) for number in numbers]


def test_the_page_counts_routes_and_episodes(results: Results) -> None:
    settings = {len(driven.settings) for driven in results.agents.values()}
    episodes = len(results.routes) * len(results.seeds) * len(AGENTS) * settings.pop()
    assert not settings
    assert f"{len(results.routes)}, with seed" in SENTENCES
    assert f"{episodes:,} episodes" in SENTENCES


def test_the_table_of_the_parts_is_counted(parts: Sequence[Results]) -> None:
    rows = {row[1]: row[0] for row in re.findall(r"^(\| `(\w+)` \| .* \|)$", PAGE, re.MULTILINE)}
    for agent in AGENTS:
        scores = [driving_score(Drives(one, READINGS[0]), agent, (CLEAN,)).value for one in parts]
        cells = [", ".join(f"{score:.1f}" for score in scores)]
        for reading in READINGS:
            for name in ("avg. perturbed", "avg. latency"):
                lost = [degradation(Drives(one, reading), agent, AVERAGES[name]).value for one in parts]
                cells.append(", ".join(f"{rd + 0.0:.2f}".replace("-0.00", "0.00") for rd in lost))
        assert rows[agent] == f"| `{agent}` | {' | '.join(cells)} |"


def test_the_rank_correlations_of_the_parts_are_counted(parts: Sequence[Results]) -> None:
    equations, code = (
        [f"{agreement(Drives(one, reading), SETTINGS).correlation.value:.2f}" for one in parts] for reading in READINGS
    )
    first = f"{', '.join(code[:-1])} and {code[-1]} by the released code"
    assert f"{first}, {', '.join(equations[:-1])} and {equations[-1]} by the equations" in SENTENCES


def error(means: Means) -> float:
    """Return the jackknife's standard error."""
    left_out = means[1:]
    return float(np.sqrt((len(left_out) - 1) / len(left_out) * ((left_out - left_out.mean()) ** 2).sum()))


def test_the_settings_in_which_the_parts_differ_are_counted(parts: Sequence[Results]) -> None:
    apart = []
    rows = [(reading, row) for reading in READINGS for row in SETTINGS if reading == READINGS[0] or row not in SAME]
    for reading, row in rows:
        for agent in AGENTS:
            for first, second in combinations([rd_means(Drives(one, reading), agent, (row,)) for one in parts], 2):
                if abs(first[0] - second[0]) > normal_quantile(0.975) * np.hypot(error(first), error(second)):
                    apart.append(agent)
    pairs = len(list(combinations(parts, 2)))
    assert f"settings, {len(rows) * len(AGENTS)} of which there are {COUNTS[pairs]} pairs each" in SENTENCES
    assert f"{COUNTS[len(apart)]} pairs are as far apart as chance makes one in twenty" in SENTENCES
    assert f"{COUNTS[apart.count('tcp')]} of them `tcp`'s" in SENTENCES


def test_what_uniad_gains_by_standing_is_what_its_scores_say(results: Results) -> None:
    more = json.loads((BENCHMARKS / "paper" / "standing.json").read_text(encoding="utf-8"))
    stood = part(results, lambda route: route in more["routes"])
    driven = stood.agents[more["agent"]]
    assert (more["world"], more["weights"]) == (results.world["simulator"], driven.made_of["weights"])
    assert more["routes"] == list(stood.routes)
    once = {setting: scores.of_seeds[0].driving_score for setting, scores in driven.settings.items()}
    seeds = [once | more["driving_score"]["0"], more["driving_score"]["1"]]

    def gained(setting: str, scores: Sequence[Mapping[str, Sequence[float]]]) -> str:
        gains = [np.subtract(of[setting], of["clean"]) for of in scores if setting in of]
        if len(gains) < len(scores):
            return "-"
        low, high = mean_interval(np.mean(gains, axis=0).tolist())
        return f"{np.mean(gains):.1f} ({low:.1f} to {high:.1f})"

    second = "0 ms latency (reading=released)"
    rows = {"100 ms late": "100 ms latency", "one second of standing": second, "two seconds of standing": TWO_SECONDS}
    for name, setting in rows.items():
        cells = [gained(setting, of) for of in (seeds[:1], seeds[1:], seeds)]
        assert f"| {name} | {' | '.join(cells)} |" in SENTENCES
    assert f"`DS under {TWO_SECONDS} >= 1`" in SENTENCES
    explained = " ".join((BENCHMARKS / "paper" / "explanations.md").read_text(encoding="utf-8").split())
    assert gained(second, seeds).replace(" (", " points of DS (").removesuffix(")") in explained


def test_efficiency_beside_that_of_the_paper(results: Results) -> None:
    drives = Drives(results, READINGS[0])
    shares = [efficiency(drives, agent, (CLEAN,)) / PUBLISHED[agent][CLEAN].efficiency for agent in AGENTS]
    page = (BENCHMARKS / "vehicle.md").read_text(encoding="utf-8")
    assert f"{min(shares):.2f} to {max(shares):.2f} of the paper's for all four" in page


def test_the_page_of_the_agents_says_how_well_they_agree_with_the_paper(results: Results) -> None:
    page = " ".join(AGENTS_PAGE.read_text(encoding="utf-8").split())
    equations, code = (Drives(results, reading) for reading in READINGS)
    without = AVERAGES["avg. perturbed"]
    tcp, uniad, vad, simlingo = (f"{agreement(equations, without, [agent]).correlation.value:.2f}" for agent in AGENTS)
    assert vad == simlingo
    assert f"by the equations: {vad} each), `tcp` and `uniad` less clearly ({tcp} and {uniad})" in page
    everything, rest = (agreement(code, rows).correlation for rows in (SETTINGS, without))
    interval = f"{everything.value:.2f} ({everything.low:.2f} to {everything.high:.2f})"
    assert f"the rank correlation is {interval}, {rest.value:.2f} without latency" in page


def turned(bound: str) -> str:
    """Return a bound with the other sign."""
    return bound.removeprefix("-") if bound.startswith("-") or not float(bound) else f"-{bound}"


def test_intervals_in_the_explanations_stand_on_a_page_of_the_ablations() -> None:
    explained = " ".join((BENCHMARKS / "paper" / "explanations.md").read_text(encoding="utf-8").split())
    pages = "".join(page.read_text(encoding="utf-8") for page in (BENCHMARKS / "ablations").rglob("*.md"))
    here = re.sub(r"\([^()]*\) in `embedded 3` \(`\S+\.md` of `\w+~1`\)", "", explained)  # others are in the history
    found = re.findall(r"(-?\d\.\d\d) to (-?\d\.\d\d)", here)
    assert len(found) > 20
    lacking = [  # "more by" is "less by" with the other sign
        f"{low} to {high}"
        for low, high in found
        if f"{low} to {high}" not in pages and f"{turned(high)} to {turned(low)}" not in pages
    ]
    assert lacking == []
