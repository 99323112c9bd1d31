"""The three ways to a verdict, behind one face: read route by route in planned order, stop as soon as one is in.

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
from typing import Literal, Protocol, get_args

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.evidence import Decision, Wealth
from pytest_drive_robust.stats.rules import Rule

__all__ = ["EvidenceJudge", "Judge", "ListJudge", "PointJudge", "VerdictKind", "judge_by"]

VerdictKind = Literal["evidence", "list", "point"]

_ROUNDING = 1e-9
"""A sum of holds this close to 0, per route and as a share of the range, is 0: equal to the limit passes."""


class Judge(Protocol):
    """Reads one route after the other; the same reads give the same verdict."""

    @property
    def decision(self) -> Decision | None:
        """The verdict, or None while there is none."""
        ...

    @property
    def routes(self) -> int:
        """How many routes the verdict rests on."""
        ...

    def read(self, score: float, reference: float = 0.0) -> Decision | None:
        """One more route; the verdict as soon as there is one. Later routes change nothing any more."""
        ...

    def close(self) -> Decision:
        """The verdict when there are no more routes. Raises `ComparisonError` when none was read."""
        ...


class _Docket:
    """What all judges keep: the rule, the count, the verdict, and whether any reference moved at all."""

    def __init__(self, rule: Rule) -> None:
        self.rule = rule
        self.routes = 0
        self.decision: Decision | None = None
        self._compares = not rule.relative

    def _enter(self, score: float, reference: float) -> float:
        """Counts the route and gives its hold. Raises `ComparisonError` for a score that the metric cannot have."""
        hold = self.rule.hold(score, reference)
        reach = 1.0 + _ROUNDING
        if not -self.rule.floor * reach - _ROUNDING <= hold <= self.rule.most * reach + _ROUNDING:
            raise ComparisonError(f"a score is {score!r} (reference {reference!r}), outside what its metric can be.")
        self.routes += 1
        self._compares = self._compares or reference > 0.0
        return hold

    def _require_routes(self) -> None:
        if self.routes == 0:
            raise ComparisonError("there is no pair to judge. Expected one clean and one perturbed score per route.")


class EvidenceJudge(_Docket):
    """Routes and seeds are a sample: `Evidence` on the two linear forms of the rule.

    While every reference is 0 there is nothing to compare with, so nothing is decided; at the end that is
    inconclusive.
    """

    def __init__(self, rule: Rule, *, alpha: float = 0.05, fail_alpha: float | None = None) -> None:
        super().__init__(rule)
        self.evidence = rule.evidence(alpha, fail_alpha=fail_alpha)

    def read(self, score: float, reference: float = 0.0) -> Decision | None:
        """One more route; the verdict as soon as there is one."""
        if self.decision is None:
            found = self.evidence.read(self._enter(score, reference), self.rule.slack(score, reference))
            self.decision = found if self._compares else None
        return self.decision

    def close(self) -> Decision:
        """The last look."""
        self._require_routes()
        if self.decision is None:
            self.decision = self.evidence.close() if self._compares else "inconclusive"
        return self.decision


class PointJudge(_Docket):
    """The plain comparison of all routes: red half of the time when the agent sits exactly on the limit."""

    def __init__(self, rule: Rule) -> None:
        super().__init__(rule)
        self._holds: list[float] = []

    def read(self, score: float, reference: float = 0.0) -> Decision | None:
        """One more route; never a verdict before the end."""
        if self.decision is None:
            self._holds.append(self._enter(score, reference))
        return self.decision

    def close(self) -> Decision:
        """Pass when the mean meets the limit, and when it is equal to it."""
        self._require_routes()
        if self.decision is None:
            self.decision = (
                _sign_of(math.fsum(self._holds), self.routes, self.rule) if self._compares else "inconclusive"
            )
        return self.decision


class ListJudge(_Docket):
    """The `planned` routes and seeds are all there is: the verdict is that of the full list.

    Betting without replacement stops early: if the full list passes, the routes that are left must make up for those
    read, so their mean is known to be `-sum / left` at least, and the gamblers bet against that (Waudby-Smith and
    Ramdas 2020, "Confidence sequences for sampling without replacement"). It disagrees with the full list at most
    `alpha` of the time over the shuffles of the planned order, and never when all were read or when the routes left
    could not turn it.
    """

    def __init__(self, rule: Rule, *, planned: int, alpha: float = 0.05) -> None:
        super().__init__(rule)
        if not 0.0 < alpha < 0.5:
            raise ValueError(f"alpha is {alpha!r}, expected a number between 0 and 0.5 such as 0.05.")
        self.planned = planned
        self.needed = 1.0 / alpha
        self.against, self.within = Wealth(), Wealth()
        self._holds: list[float] = []
        self._sum = 0.0

    def read(self, score: float, reference: float = 0.0) -> Decision | None:
        """One more route; the verdict as soon as there is one. Raises `ComparisonError` beyond the list."""
        if self.decision is None:
            left = self.planned - self.routes
            if left <= 0:
                raise ComparisonError(f"the list has {self.planned} routes, but one more was read.")
            hold = self._enter(score, reference)
            self._bet(hold, -self._sum / left)
            self._holds.append(hold)
            self._sum += hold
            self.decision = self._look(left - 1)
        return self.decision

    def close(self) -> Decision:
        """Inconclusive unless the whole list was read or the verdict was in before."""
        self._require_routes()
        if self.decision is None:
            self.decision = "inconclusive"
        return self.decision

    def _bet(self, hold: float, due: float) -> None:
        """`due` is what the routes left must average for the list to sit exactly on the limit."""
        nothing = _ROUNDING * self.rule.scale
        self.against.bet(_stake(due - hold, self.rule.most - due, nothing))
        self.within.bet(_stake(hold - due, self.rule.floor + due, nothing))

    def _look(self, left: int) -> Decision | None:
        if not self._compares:
            return None if left else "inconclusive"
        if left == 0:
            return _sign_of(math.fsum(self._holds), self.planned, self.rule)
        if self.against.value >= self.needed or self._sum + left * self.rule.most < -_slop(self.planned, self.rule):
            return "fail"
        if self.within.value >= self.needed or self._sum - left * self.rule.floor > _slop(self.planned, self.rule):
            return "pass"
        return None


def judge_by(
    kind: VerdictKind, rule: Rule, *, planned: int, alpha: float = 0.05, fail_alpha: float | None = None
) -> Judge:
    """The judge of that name for `planned` routes; only evidence knows a `fail_alpha` of its own.

    Raises `ValueError` for another name.
    """
    if kind == "evidence":
        return EvidenceJudge(rule, alpha=alpha, fail_alpha=fail_alpha)
    if kind == "list":
        return ListJudge(rule, planned=planned, alpha=alpha)
    if kind == "point":
        return PointJudge(rule)
    raise ValueError(f"there is no verdict named {kind!r}. Expected one of: {', '.join(get_args(VerdictKind))}.")


def _sign_of(total: float, routes: int, rule: Rule) -> Decision:
    return "pass" if total >= -_slop(routes, rule) else "fail"


def _slop(routes: int, rule: Rule) -> float:
    return _ROUNDING * routes * rule.scale


def _stake(gain: float, worst: float, nothing: float) -> float:
    """`gain` as a share of the worst loss; where there is nothing to lose, any gain is proof."""
    if worst > nothing:
        return max(-1.0, gain / worst)
    return math.inf if gain > nothing else 0.0
