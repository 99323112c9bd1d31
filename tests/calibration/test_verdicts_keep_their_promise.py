"""What the verdicts promise, measured. Every rule that breaks the promise must be caught by the same study."""

from __future__ import annotations

import random

import pytest
from paper_table import PAPER
from score_model import draw_pairs, true_rd
from study import (
    all_bars,
    error_bars,
    interval_bars,
    list_bars,
    mean_bars,
    misses,
    paper_suite,
    power_bars,
    regression_bars,
    zero_bars,
)
from wrong_rules import peeking_rule, point_rule

from pytest_drive_robust.stats import gate
from pytest_drive_robust.stats.evidence import degradation_forms
from pytest_drive_robust.stats.judges import EvidenceJudge

pytestmark = pytest.mark.slow


@pytest.fixture
def share(pytestconfig: pytest.Config) -> float:
    """The share of the studies to draw: fewer only widen the standard errors that `misses` allows."""
    return 1.0 if pytestconfig.getoption("--whole-studies") else 0.4


def test_wrong_fails_and_wrong_passes_stay_at_or_under_alpha_on_every_shape(share: float) -> None:
    assert misses([*error_bars(gate, int(1000 * share)), *zero_bars(gate)]) == []


def test_violations_are_caught_and_good_agents_pass_soon(share: float) -> None:
    assert misses(list(power_bars(gate, int(500 * share)))) == []


def test_an_unchanged_agent_raises_no_alarm_against_its_stored_run(share: float) -> None:
    assert misses(list(regression_bars(gate, int(500 * share)))) == []


def test_success_scores_and_speeds_are_judged_as_rarely_wrongly(share: float) -> None:
    assert misses(list(mean_bars(int(500 * share)))) == []


def test_the_list_verdict_agrees_with_the_full_list() -> None:
    assert misses(list(list_bars(150))) == []


def test_intervals_after_an_early_stop_hold_the_truth(share: float) -> None:
    assert misses(list(interval_bars(int(100 * share)))) == []


def test_the_paper_suite_costs_less_than_half_and_fails_nothing_wrongly() -> None:
    cells, episodes = paper_suite(gate, 40)

    assert len(cells) == 44
    assert 4 * 220 + 44 * 220 == 10_560
    assert episodes <= 3_900
    assert len(PAPER) == 4
    # One wrong verdict in the 1,600 studies away from the limit would be within alpha; the truth is far rarer.
    assert sum(cell.outcome.fails for cell in cells if cell.rd < 0.28) * 40 <= 3
    assert all(cell.outcome.fails >= 0.9 for cell in cells if cell.rd > 0.42)


@pytest.mark.parametrize(("rule", "at_least"), [(point_rule, 40), (peeking_rule, 30)])
def test_the_study_catches_a_rule_that_breaks_the_promise(rule, at_least: int) -> None:
    found = misses(all_bars(rule, 100))

    assert len(found) >= at_least
    assert any("false fail: mid" in miss for miss in found)
    assert any("rare failures" in miss for miss in found)


def test_who_stops_on_what_finished_first_is_fooled_and_the_planned_order_is_not() -> None:
    # RD 0.40 against 0.30; 32 routes at a time, and the routes that went badly take twelve times as long.
    studies = 60
    limit = true_rd("strong", 0.40) - 0.10
    drawn = draw_pairs("strong", 0.40, studies=studies, routes=220, seed=3)
    passes = {"planned": 0, "finished": 0}
    for number, (clean, perturbed) in enumerate(zip(drawn[0].tolist(), drawn[1].tolist(), strict=True)):
        finishing = finishing_order(perturbed, random.Random(number))
        planned, finished = EvidenceJudge(degradation_forms(limit)), EvidenceJudge(degradation_forms(limit))
        for first, route in zip(finishing, range(220), strict=True):
            finished.read(perturbed[first], clean[first])
            planned.read(perturbed[route], clean[route])
        passes["planned"] += planned.close() == "pass"
        passes["finished"] += finished.close() == "pass"

    assert passes["planned"] <= 0.05 * studies
    assert passes["finished"] >= 0.5 * studies


def finishing_order(scores: list[float], draw: random.Random, workers: int = 32) -> list[int]:
    """The routes in the order in which `workers` finish them."""
    free, ends = [0.0] * workers, []
    for route, score in enumerate(scores):
        start = min(free)
        end = start + draw.uniform(0.8, 1.2) * (12.0 if score < 60.0 else 1.0)
        free[free.index(start)] = end
        ends.append((end, route))
    return [route for _, route in sorted(ends)]
