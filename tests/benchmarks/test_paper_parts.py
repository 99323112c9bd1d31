"""`benchmarks/paper.py`: the first route of each scenario type against the second, and so on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from _paper.parts import FEWEST_ROUTES, compared, parts_of
from _paper.parts_page import parts_text
from _paper.published import CLEAN
from _paper.readings import DRIVEN, NO_LATENCY, called_in
from _paper.results import DrivenAgent, Results, Scores, SeedScores

WARM = called_in("released", NO_LATENCY)


def driven(lost: Mapping[str, Mapping[int, float]], seed: int = 0, types: int = 44, parts: int = 3) -> Results:
    """Drive `parts` routes of each type by `tcp`: a clean score by chance, 0.7 of it and some chance under a failure.

    `lost` is what is lost besides, by setting and part.
    """
    generator = np.random.Generator(np.random.Philox(seed))
    routes = {
        f"{100 * place + part}": (f"Type{place}", "aa") for place in range(1, types + 1) for part in range(1, parts + 1)
    }
    clean = generator.uniform(40.0, 60.0, len(routes))

    def scores(setting: str) -> Scores:
        if setting in (CLEAN, WARM):
            column = clean
        else:
            more = [lost.get(setting, {}).get(int(route) % 100, 0.0) for route in routes]
            column = clean * (generator.uniform(0.4, 1.0, len(routes)) - more)
        nothing = len(routes) * (None,)
        return Scores((SeedScores(tuple(column.tolist()), len(routes) * (False,), nothing, None),))

    tcp = DrivenAgent("tcp", {"distribution": "none"}, {}, {setting: scores(setting) for setting in DRIVEN})
    return Results({"simulator": "made-up 1"}, (0,), routes, {"tcp": tcp})


def test_parts_have_every_type_once_and_each_route_with_its_score() -> None:
    whole = driven({})
    parts = parts_of(whole)
    assert [{int(route) % 100 for route in part.routes} for part in parts] == [{1}, {2}, {3}]
    assert [len({scenario for scenario, _ in part.routes.values()}) for part in parts] == [44] * 3

    def scored(results: Results) -> dict[str, float]:
        return dict(zip(results.routes, results.agents["tcp"].settings[CLEAN].driving_score, strict=True))

    assert {route: score for part in parts for route, score in scored(part).items()} == scored(whole)


def test_a_cell_in_which_one_part_loses_more_is_found_in_both_pairs_of_it() -> None:
    whole = driven({"occlusion 0.8": {2: 0.3}})
    found = compared(parts_of(whole))
    assert (found.cells, found.pairs) == (16, 48)
    planted = [one for one in found.apart if one.row == "occlusion 0.8"]
    assert [one.parts for one in planted] == [(1, 2), (2, 3)]
    less, more = planted[0].lost
    assert (less.value, more.value) == (pytest.approx(0.3, abs=0.06), pytest.approx(0.6, abs=0.06))
    page = parts_text(whole)
    assert f"| tcp | occlusion 0.8 | both | 1 | {less.value:.2f} ({less.low:.2f} to {less.high:.2f}) | 2 |" in page
    assert f"48 pairs, of which chance alone makes 2. Found: {len(found.apart)}." in page


def test_without_a_difference_one_pair_in_twenty_is_apart() -> None:
    studies = [compared(parts_of(driven({}, seed))) for seed in range(40)]
    assert 0.035 < sum(len(study.apart) for study in studies) / sum(study.pairs for study in studies) < 0.075


def test_the_column_of_all_is_the_figure_of_all_routes() -> None:
    (row,) = (line for line in parts_text(driven({})).splitlines() if line.startswith("| tcp | clean DS |"))
    *of_parts, of_all = (float(cell) for cell in row.strip("| ").split(" | ")[2:])
    assert len(of_parts) == 3
    assert of_all == pytest.approx(np.mean(of_parts), abs=0.1)


@pytest.mark.parametrize("few", [{"parts": 1}, {"types": FEWEST_ROUTES - 1}])
def test_too_few_routes_are_not_compared(few: dict[str, int]) -> None:
    assert parts_of(driven({}, **few)) == ()
    assert "No parts to compare" in parts_text(driven({}, **few))


def test_a_part_without_a_clean_score_is_not_compared() -> None:
    whole = driven({})
    standing = [0.0 if int(route) % 100 == 2 else 50.0 for route in whole.routes]
    settings = dict(whole.agents["tcp"].settings)
    settings[CLEAN] = Scores((SeedScores(tuple(standing), len(standing) * (False,), len(standing) * (None,), None),))
    tcp = DrivenAgent("tcp", {}, {}, settings)
    assert parts_of(Results(whole.world, whole.seeds, whole.routes, {"tcp": tcp})) == ()
