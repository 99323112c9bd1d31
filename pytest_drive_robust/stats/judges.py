"""The judges of the three verdict rules: each reads routes in planned order and stops when the verdict is reached.

`read_until_decided` reads a requirement for a run.

========== ============================================================ ================= ======================
name       question                                                     stops early       answers
========== ============================================================ ================= ======================
evidence   does it hold on routes and seeds like these?                 at alpha a side   pass, fail, inconclusive
list       does it hold on exactly this list of routes and seeds?       at alpha in all   pass, fail
point      is the value of this run on the right side of the limit?     never             pass, fail
========== ============================================================ ================= ======================
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.evidence import (
    EARLY_SHARE,
    FEWEST_FOR_T,
    Decision,
    LinearForms,
    Wealth,
    last_fail_p,
    last_pass_p,
    share_of,
)

_NAMES = ("evidence", "list", "point")

_ROUNDING = 1e-9
"""A sum of holds this close to 0, per route and as a share of the range, counts as 0: equal to the limit passes."""


class Judge(ABC):
    """Reads routes one by one; equal scores in equal order give the same verdict.

    `decision` is the verdict, None before it is reached; `routes` counts the routes read. `against` holds the e-value
    of a fail and must reach `needed_for_fail`; `within` holds the e-value of a pass and must reach `needed`. While
    every reference is 0 there is nothing to compare with: the judge decides nothing, and `close` is inconclusive.

    `floor` is a floor of the mean reference. With a floor, reading stops at a pass only when betting has also shown on
    which side of the floor the mean reference lies (`above_floor`, `below_floor`, `needed_for_floor`). The caller
    compares the mean reference of the routes read with the floor and decides what a pass is worth.
    """

    needed = needed_for_fail = needed_for_floor = math.inf

    def __init__(self, forms: LinearForms, *, floor: float = 0.0) -> None:
        self.forms = forms
        self.floor = floor
        self.routes = 0
        self.decision: Decision | None = None
        self.against, self.within = Wealth(), Wealth()
        self.above_floor, self.below_floor = Wealth(), Wealth()
        self._lowest = -forms.floor * (1.0 + _ROUNDING) - _ROUNDING
        self._highest = forms.most * (1.0 + _ROUNDING) + _ROUNDING
        self._holds: list[float] = []
        self._compares = not forms.relative

    def read(self, score: float, reference: float = 0.0) -> Decision | None:
        """Read one more route and return the verdict, or None before it is reached. Ignores routes after the verdict.

        Raises `ComparisonError` for a score that the metric cannot have.
        """
        if self.decision is None:
            hold = self.forms.hold(score, reference)
            if not self._lowest <= hold <= self._highest:
                raise ComparisonError(
                    f"a score is {score!r} (reference {reference!r}), outside what its metric can be."
                )
            self.routes += 1
            self._holds.append(hold)
            self._compares = self._compares or reference > 0.0
            if self.floor > 0.0:
                self._bet_on_the_floor(reference)
            self.decision = self._look(hold, self.forms.slack(score, reference))
        return self.decision

    def close(self) -> Decision:
        """End the reading and return the verdict. Raises `ComparisonError` when no route was read."""
        if self.routes == 0:
            raise ComparisonError("there is no pair to judge. Expected one clean and one perturbed score per route.")
        if self.decision is None:
            self.decision = self._at_end() if self._compares else "inconclusive"
        return self.decision

    @property
    def _may_pass(self) -> bool:
        """Whether reading may stop at a pass."""
        shown = max(self.above_floor.value, self.below_floor.value)
        return self.floor <= 0.0 or shown >= self.needed_for_floor

    def _bet_on_the_floor(self, reference: float) -> None:
        self._bet_on_references(reference, self.floor)

    def _bet_on_references(self, reference: float, due: float) -> None:
        """Bet on both sides of `due`, the value of a reference at which the mean reference equals the floor."""
        top = self.forms.top_reference
        self.above_floor.bet(_stake(reference - due, due, _ROUNDING * top))
        self.below_floor.bet(_stake(due - reference, top - due, _ROUNDING * top))

    @abstractmethod
    def _look(self, hold: float, slack: float) -> Decision | None:
        """Return the verdict after one more route, or None before it is reached."""

    @abstractmethod
    def _at_end(self) -> Decision:
        """Return the verdict at the end of the routes, if none was reached before and there is data to compare with."""


class EvidenceJudge(Judge):
    """Judges routes and seeds as a sample: bets on both linear forms after every route, takes Hall's t test at the end.

    `alpha` bounds the chance of a wrong fail, and the chance of a wrong pass. A `fail_alpha` below `alpha` makes a fail
    stricter; a fail at `alpha` that is none at `fail_alpha` is inconclusive. A side whose range has no end waits for
    the last look. On a side where the other sign is impossible, one route is proof. Raises `ValueError` for an `alpha`
    outside 0..0.5 and a `fail_alpha` outside 0..`alpha`.
    """

    def __init__(
        self, forms: LinearForms, *, alpha: float = 0.05, fail_alpha: float | None = None, floor: float = 0.0
    ) -> None:
        super().__init__(forms, floor=floor)
        _require_alpha(alpha)
        fail_alpha = alpha if fail_alpha is None else fail_alpha
        if not 0.0 < fail_alpha <= alpha:
            raise ValueError(f"the alpha of a fail is {fail_alpha!r}, expected a number above 0, {alpha} at most.")
        self._alpha, self._fail_alpha = alpha, fail_alpha
        self.needed, self.needed_for_fail = 1.0 / (alpha * EARLY_SHARE), 1.0 / (fail_alpha * EARLY_SHARE)
        self.needed_for_floor = 1.0 / alpha
        self._slacks: list[float] = []

    def _look(self, hold: float, slack: float) -> Decision | None:
        against = self.against.bet(share_of(self.forms.most, -hold))
        within = self.within.bet(share_of(self.forms.least, slack))
        self._slacks.append(slack)
        if not self._compares:
            return None
        if against >= self.needed_for_fail:
            return "fail"
        return "pass" if within >= self.needed and self._may_pass else None

    def _at_end(self) -> Decision:
        if self.within.value >= self.needed:  # the pass was shown earlier and only waited for the floor
            return "pass"
        if self.routes < FEWEST_FOR_T:
            return "inconclusive"
        p_value = last_fail_p(self._holds, self.forms.most, scale=self.forms.scale)
        if p_value <= self._alpha:
            return "fail" if p_value <= self._fail_alpha else "inconclusive"
        scale = max((bound for bound in (self.forms.most, self.forms.least) if bound < math.inf), default=1.0)
        return "pass" if last_pass_p(self._slacks, self.forms.least, scale=scale) <= self._alpha else "inconclusive"


class PointJudge(Judge):
    """Compares the value over all routes with the limit; fails half of the time for an agent exactly on the limit."""

    def _look(self, hold: float, slack: float) -> None:
        return None

    def _at_end(self) -> Decision:
        """Return a pass when the mean meets the limit or equals the limit."""
        return _sign_of(math.fsum(self._holds), self.routes, self.forms)


class ListJudge(Judge):
    """Judges exactly the `planned` routes and seeds: the verdict is that of the full list.

    Betting without replacement stops early: if the full list passes, the routes left must make up for the routes read,
    so the mean of the routes left is `-sum / left` at least, and the gamblers bet against that (Waudby-Smith and Ramdas
    2020, "Confidence sequences for sampling without replacement"). The early verdict differs from the verdict of the
    full list at most `alpha` of the time over all orders of the list, and never when all routes were read or the routes
    left cannot change the verdict. `close` before the end of the list is inconclusive. Raises `ComparisonError` for
    more routes than `planned`.
    """

    def __init__(self, forms: LinearForms, *, planned: int, alpha: float = 0.05, floor: float = 0.0) -> None:
        super().__init__(forms, floor=floor)
        _require_alpha(alpha)
        self.planned = planned
        self.needed = self.needed_for_fail = self.needed_for_floor = 1.0 / alpha
        self._sum = self._references = 0.0

    def _look(self, hold: float, slack: float) -> Decision | None:
        left = self.planned - self.routes
        if left < 0:
            raise ComparisonError(f"the list has {self.planned} routes, but one more was read.")
        self._bet(hold, -self._sum / (left + 1))
        self._sum += hold
        if not self._compares:
            return None if left else "inconclusive"
        if left == 0:
            return _sign_of(math.fsum(self._holds), self.planned, self.forms)
        if self.against.value >= self.needed or self._sum + left * self.forms.most < -_slop(self.planned, self.forms):
            return "fail"
        within = self.within.value >= self.needed
        if within or self._sum - left * self.forms.floor > _slop(self.planned, self.forms):
            return "pass" if self._may_pass else None
        return None

    def _at_end(self) -> Decision:
        return "inconclusive"

    def _bet_on_the_floor(self, reference: float) -> None:
        left = max(0, self.planned - self.routes)
        self._bet_on_references(reference, (self.floor * self.planned - self._references) / (left + 1))
        self._references += reference

    def _bet(self, hold: float, due: float) -> None:
        """Bet on both sides of `due`, the mean hold of the routes left at which the list sits exactly on the limit."""
        nothing = _ROUNDING * self.forms.scale
        self.against.bet(_stake(due - hold, self.forms.most - due, nothing))
        self.within.bet(_stake(hold - due, self.forms.floor + due, nothing))


def judge_by(
    rule: str,
    forms: LinearForms,
    *,
    planned: int,
    alpha: float = 0.05,
    fail_alpha: float | None = None,
    floor: float = 0.0,
) -> Judge:
    """Return the judge of `rule` for `planned` routes; only the rule `"evidence"` reads `fail_alpha`.

    `floor` is the floor of the mean reference of relative forms, see `Judge`.

    Raises `ValueError` for another `rule`.
    """
    if rule == "evidence":
        return EvidenceJudge(forms, alpha=alpha, fail_alpha=fail_alpha, floor=floor)
    if rule == "list":
        return ListJudge(forms, planned=planned, alpha=alpha, floor=floor)
    if rule == "point":
        return PointJudge(forms)
    raise ValueError(f"there is no verdict named {rule!r}. Expected one of: {', '.join(_NAMES)}.")


def read_until_decided(judge: Judge, scores: Iterable[tuple[float, float] | None]) -> tuple[Decision, int]:
    """Read `scores` with a fresh `judge` until the verdict; return the verdict and how many routes were taken.

    `scores` gives (score, reference) for each planned route in planned order, or None for a route without data, which
    is counted but not read. A list with fewer routes than planned is judged by its value. When no route has data, the
    verdict is inconclusive; the caller reports that the metric has no value.
    """
    read: list[tuple[float, float]] = []
    taken = 0
    for found in scores:
        taken += 1
        if found is not None:
            read.append(found)
            if judge.read(*found) is not None:
                return judge.close(), taken
    if isinstance(judge, ListJudge) and read:
        judge = PointJudge(judge.forms)
        for found in read:
            judge.read(*found)
    return judge.close() if read or not taken else "inconclusive", taken


def _require_alpha(alpha: float) -> None:
    if not 0.0 < alpha < 0.5:
        raise ValueError(f"alpha is {alpha!r}, expected a number between 0 and 0.5 such as 0.05.")


def _sign_of(total: float, routes: int, forms: LinearForms) -> Decision:
    return "pass" if total >= -_slop(routes, forms) else "fail"


def _slop(routes: int, forms: LinearForms) -> float:
    return _ROUNDING * routes * forms.scale


def _stake(gain: float, worst: float, nothing: float) -> float:
    """Return `gain` as a share of the worst loss; when nothing can be lost, any gain is proof (infinity)."""
    if worst > nothing:
        return max(-1.0, gain / worst)
    return math.inf if gain > nothing else 0.0
