"""Estimates how many routes a verdict will still read, for schedules and displays."""

from __future__ import annotations

import math

from pytest_drive_robust.stats.evidence import BETS, TOP_SCORE, LinearForms, Wealth
from pytest_drive_robust.stats.judges import Judge

_USUAL_DISTANCE = 0.2
"""The usual distance of a value from its limit, as a share of the metric's range."""

_USUAL_REFERENCE = 0.85
"""The usual reference of a relative form, as a share of the top score."""

_USUAL_WEIGHT = 4.0
"""The weight of the usual distance in the pace of the evidence, in routes read."""


def likely_left(judge: Judge, planned: int) -> int:
    """Return how many more of the `planned` routes are read if the evidence grows at the pace so far."""
    left = max(0, planned - judge.routes)
    if judge.decision is not None:
        return 0
    usual = _usual_routes(judge.forms, judge.needed) if judge.needed < math.inf else math.inf
    passing = _share(judge.within, judge.needed)
    if judge.floor > 0.0:
        shown = max(_share(side, judge.needed_for_floor) for side in (judge.above_floor, judge.below_floor))
        passing = min(passing, shown)
    way = max(_share(judge.against, judge.needed_for_fail), passing)
    pace = (way + _USUAL_WEIGHT / usual) / (judge.routes + _USUAL_WEIGHT)
    return left if pace <= 0.0 else min(left, math.ceil((1.0 - way) / pace))


def _usual_routes(forms: LinearForms, needed: float) -> float:
    """Return after how many routes the boldest gambler reaches `needed` if every route lies at the usual distance."""
    if forms.least <= 0.0:
        return 1.0
    if math.isinf(forms.least):
        return math.inf
    span = min(forms.most + forms.floor, TOP_SCORE)
    if forms.relative:
        reference = _USUAL_REFERENCE * forms.top_reference
        kept = min(1.0, max(0.0, forms.keep + forms.sign * _USUAL_DISTANCE))
        slack = forms.slack(kept * reference, reference)
    else:
        slack = forms.slack(forms.base) + min(_USUAL_DISTANCE * span, forms.most)
    if slack <= 0.0:  # not even the best scores would meet the limit
        return math.inf
    return math.log(len(BETS) * needed) / math.log1p(max(BETS) * slack / forms.least)


def _share(wealth: Wealth, needed: float) -> float:
    """Return the progress of `wealth` towards `needed`, 0..1, on a log scale, where equal evidence adds up."""
    return min(1.0, max(0.0, math.log(max(wealth.value, 1.0)) / math.log(needed)))
