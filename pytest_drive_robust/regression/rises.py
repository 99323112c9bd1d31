"""How much RD changed from one run to another, with its interval: the size of what a verdict only judges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum
from statistics import fmean

from pytest_drive_robust.stats.intervals import jackknife_interval

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
        """The four of them."""
        return self.clean_before, self.before, self.clean_after, self.after


@dataclass(frozen=True, slots=True)
class Rise:
    """RD of both runs over the same routes, and the 95 % interval of what it rose by; negative is better.

    With several `settings` all of it is of their mean.
    """

    before: float
    after: float
    low: float
    high: float
    routes: int
    settings: int


def rise_of(*settings: Sequence[Quartet]) -> Rise | None:
    """Return how much the RD of a setting rose, or the mean RD of several, over the routes that all of them have.

    The interval is the jackknife's, over routes. None below two routes, and where a clean mean is 0 with or without
    some route: then there is no RD to compare.
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
    """Return before and after, the mean over settings."""
    return (
        fmean(1.0 - before / clean for clean, before, _, _ in sums),
        fmean(1.0 - after / clean for _, _, clean, after in sums),
    )
