"""What the pages say of the committed table of the paper is what `results.json` holds."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from _paper.agreement import agreement
from _paper.differences import differences, pages_on
from _paper.estimates import driving_score, efficiency, success_rate
from _paper.joining import read
from _paper.parts import on_routes
from _paper.published import AGENTS, AVERAGES, CLEAN, PUBLISHED, SETTINGS
from _paper.readings import READINGS, Drives
from _paper.results import Results

from pytest_drive_robust.stats.intervals import mean_interval

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
AGENTS_PAGE = BENCHMARKS.parent / "docs" / "gallery" / "agents.md"
PAGE = (BENCHMARKS / "paper" / "README.md").read_text(encoding="utf-8")
SENTENCES = " ".join(PAGE.split())  # wherever their lines end


@pytest.fixture(scope="module")
def results() -> Results:
    return read([BENCHMARKS / "paper" / "results.json"])


def test_the_page_counts_routes_and_episodes(results: Results) -> None:
    settings = {len(driven.settings) for driven in results.agents.values()}
    episodes = len(results.routes) * len(results.seeds) * len(AGENTS) * settings.pop()
    assert not settings
    assert (
        f"{len(results.routes)}, with seeds {' and '.join(map(str, results.seeds))}, {episodes:,} episodes" in SENTENCES
    )


def test_what_uniad_gains_by_late_commands_and_by_standing_is_what_its_scores_say(results: Results) -> None:
    settings, standing = results.agents["uniad"].settings, "0 ms latency (reading=released)"

    def gain(setting: str, seeds: slice, over: str = CLEAN, routes: str = "12345") -> str:
        """Return the points of DS that `setting` gains over another; `routes` are their places in their type."""
        late, before = (
            np.mean([of.driving_score for of in settings[one].of_seeds[seeds]], 0) for one in (setting, over)
        )
        gains = (late - before)[[route[-1] in routes for route in results.routes]]
        low, high = mean_interval(gains.tolist())
        return f"{gains.mean():.1f} ({low:.1f} to {high:.1f})"

    first, second, both = slice(0, 1), slice(1, 2), slice(None)
    rows = {f"{ms} ms late": f"{ms} ms latency" for ms in (100, 200, 500)} | {"one second of standing": standing}
    for name, setting in rows.items():
        assert f"| {name} | {' | '.join(gain(setting, seeds) for seeds in (first, second, both))} |" in SENTENCES
    more, much_more = (gain(f"{ms} ms latency", both, over=standing) for ms in (100, 200))
    assert (
        f"100 ms late gain {more.replace(' (', ' points more than a second of standing (')}, 200 ms late {much_more}."
        in SENTENCES
    )
    early, late = gain(standing, both, routes="123"), gain(standing, both, routes="45")
    assert f"as much as 100 ms late, {early.replace(' (', ' points (')}, on the other two {late}." in SENTENCES
    explained = " ".join((BENCHMARKS / "paper" / "explanations.md").read_text(encoding="utf-8").split())
    assert f"100 ms gain {gain('100 ms latency', both).replace(' (', ' points of DS (')}" in explained
    assert f"in which nothing fails, {gain(standing, both).removesuffix(')')}; `README.md`)" in explained


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
    assert f"by the equations: {simlingo} and {vad}), `tcp` and `uniad` less clearly ({tcp} and {uniad})" in page
    everything, rest = (agreement(code, rows).correlation for rows in (SETTINGS, without))
    interval = f"{everything.value:.2f} ({everything.low:.2f} to {everything.high:.2f})"
    assert f"the rank correlation is {interval}, {rest.value:.2f} without latency" in page


def test_the_page_of_the_agents_says_how_simlingo_does_on_the_judged_routes(results: Results) -> None:
    page, clean = " ".join(AGENTS_PAGE.read_text(encoding="utf-8").split()), Drives(results, READINGS[0])
    score, passed = (of(clean, "simlingo", (CLEAN,)) for of in (driving_score, success_rate))
    share = f"{100 * passed.value:.0f} % ({100 * passed.low:.0f} to {100 * passed.high:.0f})"
    scored = f"DS {score.value:.1f} ({score.low:.0f} to {score.high:.0f})"
    assert f"On all {len(results.routes)} judged routes, with two seeds each, `simlingo` has a clean" in page
    assert f"with two seeds each, `simlingo` has a clean success of {share}, {scored}." in page


def test_whatever_differs_from_the_paper_by_the_released_code_has_an_ablation(results: Results) -> None:
    cells = differences(Drives(results, "released"))
    assert cells
    assert [(cell.agent, cell.row) for cell in cells if not pages_on(cell.agent, cell.row)] == []


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


def test_agents_as_they_ship_drive_on_the_pages_of_the_ablations_as_in_the_table(results: Results) -> None:
    stop_s, warm = 45.0, "0 ms latency (reading=released)"  # the stop of the ablations
    first = on_routes(results, [route for route in results.routes if route.endswith("01")])
    of_pages = {f"{len(kept.routes)} routes, seed 0.": kept for kept in (results, first)}
    rows = 0
    for page in (BENCHMARKS / "ablations").rglob("*.md"):
        text, driven = page.read_text(encoding="utf-8"), results.agents.get(page.stem)
        if driven is None:  # the page that lists the others
            continue
        kept = of_pages[text.partition("\n")[0]]
        within = 0.051 if driven.stuck_stop_s == stop_s else 1.0  # another stop ends some episodes otherwise
        for setting, *shown in re.findall(r"^\| (.+) \| as-shipped \| (\S+) \| (\S+) \|", text, flags=re.MULTILINE):
            if setting not in driven.settings:
                continue
            clean = warm if setting.endswith("latency (reading=released)") else CLEAN
            scores = kept.agents[page.stem].settings
            here = [np.mean(scores[name].of_seeds[0].driving_score) for name in (clean, setting)]
            assert [float(score) for score in shown] == pytest.approx(here, abs=within), f"{page}: {setting}"
            rows += 1
    assert rows > 20
