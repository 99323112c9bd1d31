"""Judges one allowance from the scores by route before and after, by the verdict rules of every other gate.

A drop of DS or SR is judged as the degradation of the new scores against the stored scores, without a clean run. A rise
of RD needs the clean scores of both runs and one look at the end, because a difference of two ratios is no sum over
routes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import fsum
from statistics import fmean

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.regression.allowance import Allowance
from pytest_drive_robust.stats.evidence import (
    FEWEST_FOR_T,
    TOP_SCORE,
    Decision,
    LinearForms,
    degradation_forms,
    mean_below_zero_p,
    mean_forms,
    unseen_p,
)
from pytest_drive_robust.stats.intervals import jackknife_interval
from pytest_drive_robust.stats.judges import judge_by, read_until_decided
from pytest_drive_robust.verdict.explain import why_rd_says_nothing

_Sums = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Quartet:
    """The driving scores (0..100) of one route in two runs, clean and perturbed."""

    route_id: str
    clean_before: float
    before: float
    clean_after: float
    after: float

    @property
    def scores(self) -> _Sums:
        """The four scores: clean before, before, clean after, after."""
        return self.clean_before, self.before, self.clean_after, self.after


@dataclass(frozen=True, slots=True)
class Rise:
    """RD of both runs over common routes, and the 95 % interval `low..high` of the rise; a negative rise is better.

    With several `settings`, all numbers are of the mean RD over the settings.
    """

    before: float
    after: float
    low: float
    high: float
    routes: int
    settings: int


def rise_of(*settings: Sequence[Quartet]) -> Rise | None:
    """Return the rise of a setting's RD, or of the mean RD of several settings, over the routes that all of them have.

    The interval is a jackknife over routes. Returns None for fewer than two routes, and when a clean mean is 0 over all
    routes or with one route left out, because RD is then undefined.
    """
    by_route = [{quartet.route_id: quartet.scores for quartet in quartets} for quartets in settings]
    routes = [route for route in by_route[0] if all(route in scores for scores in by_route)] if by_route else []
    if len(routes) < 2:
        return None
    sums = [_sums([scores[route] for route in routes]) for scores in by_route]
    without = [[_less(total, scores[route]) for total, scores in zip(sums, by_route, strict=True)] for route in routes]
    if min(min(left[0], left[2]) for lefts in (sums, *without) for left in lefts) <= 0.0:
        return None
    before, after = _mean_rds(sums)
    others = [new - old for old, new in map(_mean_rds, without)]
    return Rise(before, after, *jackknife_interval(after - before, others), len(routes), len(settings))


def _sums(rows: Sequence[_Sums]) -> _Sums:
    first, second, third, fourth = (fsum(column) for column in zip(*rows, strict=True))
    return first, second, third, fourth


def _less(total: _Sums, row: _Sums) -> _Sums:
    return total[0] - row[0], total[1] - row[1], total[2] - row[2], total[3] - row[3]


def _mean_rds(sums: Sequence[_Sums]) -> tuple[float, float]:
    """Return the mean RD over settings, before and after."""
    return (
        fmean(1.0 - before / clean for clean, before, _, _ in sums),
        fmean(1.0 - after / clean for _, _, clean, after in sums),
    )


_ALPHA = 0.05
MARGIN = 0.10
"""The margin: how far beyond the allowance a pass may lie, as a share of the metric's range."""


def rule_for(asked: str, routes: int, *, same_seeds: bool, changed: int) -> str:
    """Return the rule for `routes` common routes: `asked`; for `"auto"`, `"evidence"` from 20 routes on, else `"list"`.

    A run chooses alike. Two exceptions of `"auto"`: with other seeds the rule is `"evidence"` for any number of routes,
    because other seeds are another list; with equal seeds and no changed score the rule is `"list"`, because a missing
    change needs no evidence.
    """
    if asked == "auto" and not same_seeds:
        return "evidence"
    if asked == "auto" and not changed:
        return "list"
    return VerdictRule(asked).for_routes(routes).kind


def judge_drop(pairs: Sequence[tuple[float, float]], allowance: Allowance, *, rule: str = "evidence") -> Decision:
    """Judge whether DS or SR dropped by more than allowed. `pairs` are (before, after) of each route in planned order.

    `"fail"`: the drop is larger than the allowance; `"pass"`: the drop is not larger than the allowance plus the
    margin. By evidence, each is wrong at most 1 time in 20 on routes like these. Raises `ComparisonError` for no pair.
    """
    rule = "point" if rule == "list" else rule  # the whole list is known: do not stop early
    scores = ((after, before) if allowance.relative else (after - before, 0.0) for before, after in pairs)
    return read_until_decided(judge_by(rule, _forms(allowance), planned=len(pairs), alpha=_ALPHA), scores)[0]


def judge_rise(routes: Sequence[Quartet], allowance: Allowance, *, rule: str = "evidence") -> Decision:
    """Judge whether RD rose by more than allowed. By evidence, fewer than 20 routes are inconclusive.

    If a mean clean driving score is below the floor (`VerdictRule.clean_floor`), RD shows nothing: a pass becomes
    inconclusive, and a fail stays a fail unless a mean clean score is 0.

    Evidence computes one value per route (the influence of the route on both ratios), whose mean is the distance of the
    rise from the allowance. The last look of the gate judges these values by Hall's t test, with one pessimistic pseudo
    route on the pass side. The fail side also counts the chance that a kind of routes was never drawn: routes with a
    score of 0 before, full scores now and usual clean scores. An opposite change of a route's clean score at the same
    time is not considered.
    """
    decision = _decide_rise(routes, allowance, rule=rule)
    return "inconclusive" if below_floor(routes) and decision == "pass" else decision


def below_floor(routes: Sequence[Quartet]) -> str:
    """Return why a rise of RD cannot pass: a mean clean score below the floor; an empty string when it can."""
    means = fmean(route.clean_before for route in routes), fmean(route.clean_after for route in routes)
    return why_rd_says_nothing(min(means), VerdictRule().clean_floor)


def _decide_rise(routes: Sequence[Quartet], allowance: Allowance, *, rule: str) -> Decision:
    """Judge as `judge_rise` does, without its floor."""
    clean_before, clean_after = (fmean(route.clean_before for route in routes), fmean(r.clean_after for r in routes))
    if clean_before <= 0.0 or clean_after <= 0.0:
        return "inconclusive"
    kept_before = fmean(route.before for route in routes) / clean_before
    kept_after = fmean(route.after for route in routes) / clean_after
    room = allowance.amount - (kept_before - kept_after)
    if rule != "evidence":
        return "pass" if room >= -1e-9 else "fail"
    if len(routes) < FEWEST_FOR_T:
        return "inconclusive"
    holds = [
        room
        + (route.after - kept_after * route.clean_after) / clean_after
        - (route.before - kept_before * route.clean_before) / clean_before
        for route in routes
    ]
    best = max(*holds, allowance.amount + TOP_SCORE / clean_after)
    if max(mean_below_zero_p(holds), unseen_p(holds, best)) <= _ALPHA:
        return "fail"
    slacks = [hold + MARGIN for hold in holds]
    return "pass" if 1.0 - mean_below_zero_p([*slacks, min(*slacks, MARGIN - 1.0)]) <= _ALPHA else "inconclusive"


def _forms(allowance: Allowance) -> LinearForms:
    if allowance.relative:
        # not `relative`, so that an old run with scores of 0 can be judged: nothing can have dropped
        return replace(degradation_forms(allowance.amount, MARGIN, top_score=allowance.top), relative=False)
    top = allowance.top
    return mean_forms(-allowance.amount, ">=", margin=MARGIN * top, low=-top, high=top)
