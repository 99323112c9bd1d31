"""`benchmarks/seeds.py`: the same drives with two seeds."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from _paper.joining import read
from _paper.published import CLEAN
from _paper.readings import DRIVEN, NO_LATENCY, called_in
from _paper.results import DrivenAgent, Results, Scores, SeedScores, text_of
from _paper.seeds import apart_of, difference, on_routes_of, two_seeds
from _paper.seeds_page import seeds_text

from pytest_drive_robust.errors import ComparisonError

ROOT = Path(__file__).parents[2]
PAPER = ROOT / "benchmarks" / "paper"
WARM = called_in("released", NO_LATENCY)


def driven(
    seed: int,
    share: float,
    lost: Mapping[str, float] | None = None,
    routes: int = 220,
    study: int = 0,
    names: Sequence[str] = DRIVEN,
) -> Results:
    """Drive `tcp`: scores, half of them under a failure, of whose variance `share` is the routes', the rest the seed's.

    `lost` is what is lost besides, by setting; `names` are the settings.
    """
    of_routes = np.random.Generator(np.random.Philox([study, 99]))
    of_seed = np.random.Generator(np.random.Philox([study, seed]))

    def column(setting: str) -> list[float]:
        route, chance = of_routes.normal(size=routes), of_seed.normal(size=routes)
        scores = 50.0 + 5.0 * (np.sqrt(share) * route + np.sqrt(1.0 - share) * chance)
        kept = 1.0 if setting in (CLEAN, WARM) else 0.5 - (lost or {}).get(setting, 0.0)
        return [float(score) for score in kept * scores]

    settings = {
        setting: Scores((SeedScores(tuple(scores), tuple(score > 50.0 for score in scores), routes * (None,), None),))
        for setting in names
        for scores in [column(setting)]
    }
    facts = {str(101 + place): ("Type", "aa") for place in range(routes)}
    tcp = DrivenAgent("tcp", {"weights": "aa"}, {}, settings, 30.0)
    return Results({"simulator": "made-up 1"}, (seed,), facts, {"tcp": tcp})


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
def test_the_share_of_the_routes_is_found(share: float) -> None:
    found = on_routes_of((driven(0, share), driven(1, share)), "tcp")
    assert found.score == pytest.approx(share, abs=0.04)
    assert found.degradation == pytest.approx(share, abs=0.04)
    assert (found.episodes, found.other_score) == (220 * len(DRIVEN), 220 * len(DRIVEN))


def test_a_seed_that_changes_nothing_leaves_all_to_the_routes() -> None:
    same = driven(0, 0.5)
    found = on_routes_of((same, replace(same, seeds=(1,))), "tcp")
    assert (found.other_score, found.other_success, found.score) == (0, 0, 1.0)
    assert apart_of((same, same)) == []
    assert "| tcp | 3960 | 0 % | 0 % | 1.00 | 1.00 | 0 % more routes |" in seeds_text((same, replace(same, seeds=(1,))))


def test_a_cell_that_loses_more_with_one_seed_is_found() -> None:
    seeds = driven(0, 0.5), driven(1, 0.5, {"occlusion 0.8": 0.2})
    planted = [one for one in apart_of(seeds) if one.row == "occlusion 0.8"]
    assert [round(lost.value, 1) for one in planted for lost in one.lost] == [0.5, 0.7]
    more = difference(seeds, "paper", "tcp", ("occlusion 0.8",))
    assert more is not None
    assert more.low < 0.2 < more.high
    assert f"| tcp | occlusion 0.8 | both | {planted[0].lost[0].value:.2f} (" in seeds_text(seeds)


def test_without_a_difference_one_cell_in_twenty_is_apart() -> None:
    names = (CLEAN, "occlusion 0.8")  # cells of one agent share its clean drive, so they are apart together
    studies = [
        (driven(0, 0.5, routes=44, study=study, names=names), driven(1, 0.5, routes=44, study=study, names=names))
        for study in range(200)
    ]
    assert 0.015 < sum(len(apart_of(study)) for study in studies) / len(studies) < 0.095


def test_routes_and_agents_that_one_seed_lacks_are_left_out() -> None:
    first, second = driven(0, 0.5), driven(1, 0.5, routes=44)
    first = replace(first, agents={**first.agents, "vad": first.agents["tcp"]})
    kept = two_seeds([second, first])
    assert [results.seeds for results in kept] == [(0,), (1,)]
    assert [list(results.agents) for results in kept] == [["tcp"], ["tcp"]]
    assert all(list(results.routes) == list(second.routes) for results in kept)
    assert kept[0].agents["tcp"].settings[CLEAN].driving_score == first.agents["tcp"].settings[CLEAN].driving_score[:44]


FIRST, SECOND = driven(0, 0.5), driven(1, 0.5)


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ([FIRST], "the files hold the seeds 0. Expected two"),
        ([FIRST, SECOND, SECOND], "the files hold the seeds 0, 1, 1. Expected two, each in one file"),
        ([FIRST, replace(SECOND, world={"simulator": "made-up 2"})], "one seed was driven in"),
        (
            [FIRST, replace(SECOND, routes=dict.fromkeys(SECOND.routes, ("Type", "bb")))],
            "101, 102, 103, 104, 105 have these",
        ),
        ([FIRST, replace(SECOND, routes={"7": ("Type", "aa")})], "share fewer than two routes"),
        ([FIRST, replace(SECOND, agents={})], "or no agent"),
        ([FIRST, driven(1, 0.5, names=DRIVEN[:-1])], f"tcp under {DRIVEN[-1]} was driven with one of the seeds only"),
        (
            [FIRST, replace(SECOND, agents={"tcp": replace(SECOND.agents["tcp"], made_of={"weights": "bb"})})],
            "tcp was driven as tcp (weights aa, stopped after 30.0 s) and as tcp (weights bb",
        ),
    ],
    ids=[
        "one seed",
        "a seed twice",
        "another world",
        "other definitions",
        "other routes",
        "no agent",
        "other settings",
        "other weights",
    ],
)
def test_what_cannot_be_compared_is_refused(files: Sequence[Results], said: str) -> None:
    with pytest.raises(ComparisonError, match=re.escape(said)):
        two_seeds(files)


def test_the_page_is_written_by_its_command(tmp_path: Path) -> None:
    files = [tmp_path / "0.json", tmp_path / "1.json"]
    for seed, path in enumerate(files):
        path.write_text(text_of(driven(seed, 0.5, routes=44)), encoding="utf-8")
    page = tmp_path / "seeds.md"
    command = [sys.executable, str(ROOT / "benchmarks" / "seeds.py"), *map(str, files), "--write", str(page)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert page.read_text(encoding="utf-8") == seeds_text(
        two_seeds([driven(0, 0.5, routes=44), driven(1, 0.5, routes=44)])
    )
    refused = subprocess.run([*command[:3], "--write", str(page)], capture_output=True, text=True, check=False)
    assert (refused.returncode, refused.stderr.splitlines()[0][:36]) == (1, "error: the files hold the seeds 0. E")


def test_the_committed_page_is_of_the_committed_results_and_quoted_where_seeds_are_explained() -> None:
    seeds = two_seeds([read([PAPER / "results.json"])])
    written = (PAPER / "seeds.md").read_text(encoding="utf-8")
    assert written == seeds_text(seeds)
    sentences = " ".join((PAPER / "README.md").read_text(encoding="utf-8").split())
    routes, episodes = len(seeds[0].routes), len(seeds[0].agents) * len(DRIVEN) * len(seeds[0].routes)
    assert f"{routes}, with seeds 0 and 1, {2 * episodes:,} episodes" in sentences
    cells, by_chance = re.findall(r"Of (\d+) cells,[^.]*chance alone makes (\d+\.\d)", written)[0]
    assert f"the seeds differ in {len(apart_of(seeds))} of the {cells} cells of the table," in sentences
    assert f"where chance alone makes {by_chance} (" in sentences
    page = " ".join((ROOT / "docs" / "explanation" / "verdicts.md").read_text(encoding="utf-8").split())
    shares = {agent: on_routes_of(seeds, agent).degradation for agent in seeds[0].agents}
    worth = {agent: f"{100 * (1 - share) / (1 + share):.0f} %" for agent, share in shares.items()}
    assert f"On the same {len(seeds[0].routes)} routes, under {len(DRIVEN)} settings, a second seed takes" in page
    told = page[page.index("a second seed takes") : page.index("(`benchmarks/paper/seeds.md`)")]
    assert set(re.findall(r"\d+ %", told)) == set(worth.values())
    assert all(f"`{agent}`" in told for agent in worth)
