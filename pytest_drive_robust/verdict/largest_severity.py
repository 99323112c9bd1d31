"""Searches the largest severity at which a requirement still holds, by bisection over a ladder; returns a bracket."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.ladder import Ladder
from pytest_drive_robust.stats.evidence import FEWEST_FOR_T
from pytest_drive_robust.verdict.evaluate import Decide, Verdict
from pytest_drive_robust.verdict.known_metrics import known_metric
from pytest_drive_robust.verdict.requirement import Requirement

Answer = Literal["holds", "breaks", "undecided"]
SearchRule = Literal["evidence", "point"]
_Ends = tuple[float, float]
ALPHA = 0.1
"""The alpha per severity and side. A bisection asks some five severities; only those at the crossing are in doubt."""

_NO_MARGIN = 1e-9
"""The margin of the search, practically 0, because the crossing itself is searched. A rule needs a number above 0."""

_ANSWERS: dict[str, Answer] = {"pass": "holds", "fail": "breaks"}

_NOTABLE = 0.05
"""The share of the metric's range by which a milder severity must be worse for a warning (`contradictions`)."""


@dataclass(frozen=True, slots=True)
class SeverityProbe:
    """One severity that was tried. `value` is the metric over the `routes` that were read.

    `answer` is `"undecided"` when neither side could be shown; the search then goes to more severe levels if the value
    `meets` the limit, else to milder ones. `reason` is the reason of the verdict.
    """

    level: float
    answer: Answer
    value: float
    meets: bool
    routes: int
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Bracket:
    """The two severities between which `metric comparison limit` stops to hold.

    `holds` is the largest severity that was shown to hold with nothing broken below it; None when there is none.
    `breaks` is the smallest severity that was shown to break; None when there is none. `rule` says what "shown" means:
    `"evidence"` (`stats.judges.EvidenceJudge` with margin 0 and `alpha` a side) or `"point"` (the value over all routes
    compared with the limit, for too few routes or a user's metric). `warnings` are sentences.

    A bracket compares with a perturbation or a number: `drive.largest(InferenceLatency) >= InferenceLatency(ms=150)` is
    True if 150 ms or more were shown to hold, and `<` if 150 ms or less were shown to break. Both are False if neither
    was shown.
    """

    ladder: Ladder
    metric: Metric
    comparison: str
    limit: float
    rule: SearchRule
    alpha: float
    probes: tuple[SeverityProbe, ...]
    warnings: tuple[str, ...] = ()

    @property
    def breaks(self) -> float | None:
        """The smallest severity that was shown to break, or None."""
        return next((probe.level for probe in self._mild_first() if probe.answer == "breaks"), None)

    @property
    def holds(self) -> float | None:
        """The largest severity that was shown to hold, below all severities that break, or None."""
        best = None
        for probe in self._mild_first():
            if probe.answer == "breaks":
                break
            best = probe.level if probe.answer == "holds" else best
        return best

    @property
    def undecided(self) -> tuple[float, ...]:
        """The severities that were tried without an answer, mildest first."""
        return tuple(probe.level for probe in self._mild_first() if probe.answer == "undecided")

    @property
    def sentence(self) -> str:
        """The bracket in words, such as `"holds at 150 ms, breaks at 200 ms"`."""
        label = self.ladder.label
        mildest, worst = self.ladder.levels[0], self.ladder.levels[-1]
        parts = [f"holds at {label(self.holds)}"] if self.holds is not None else []
        if self.breaks is not None:
            already = " already" if self.breaks == mildest else ""
            parts.append(f"breaks{already} at {label(self.breaks)}")
        elif self.holds == worst:
            parts[-1] += ", the most severe one tried"
        if self.undecided:
            parts.append(f"undecided at {', '.join(map(label, self.undecided))}")
        return ", ".join(parts)

    @property
    def basis(self) -> str:
        """The rule and the number of routes behind the bracket, in words."""
        read = [probe.routes for probe in self.probes]
        if self.rule == "point":
            on = f"point rule on {max(read)} {'route' if max(read) == 1 else 'routes'}"
            own = self.metric.function is not None
            return f"{on}, as for all metrics of your own" if own else f"{on}, too few to show more"
        routes = f"{min(read)} to {max(read)}" if min(read) < max(read) else f"{max(read)}"
        return f"evidence at {self.alpha:g} a side, margin 0, {routes} routes a severity"

    def __str__(self) -> str:
        limit = self.metric.format_limit(self.limit)
        head = f"{self.metric} {self.comparison} {limit} under {self.ladder.name}: {self.sentence} ({self.basis})"
        return "\n  ".join([head, *self.warnings])

    __repr__ = __str__

    def __eq__(self, other: object) -> bool:
        return self._compare(other, lambda own, theirs: own[0] == own[1] == theirs[0] == theirs[1])

    def __lt__(self, other: object) -> bool:
        return self._compare(other, lambda own, theirs: own[1] < theirs[0])

    def __le__(self, other: object) -> bool:
        return self._compare(other, lambda own, theirs: own[1] <= theirs[0])

    def __gt__(self, other: object) -> bool:
        return self._compare(other, lambda own, theirs: own[0] > theirs[1])

    def __ge__(self, other: object) -> bool:
        return self._compare(other, lambda own, theirs: own[0] >= theirs[1])

    __hash__ = object.__hash__

    def _compare(self, other: object, is_shown: Callable[[_Ends, _Ends], bool]) -> bool:
        theirs = self._ends_of(other)
        return NotImplemented if theirs is None else is_shown(self._ends(), theirs)

    def _ends(self) -> _Ends:
        """Return between which severities the largest that holds lies: two unlike ones where some are undecided."""
        above = self.ladder.levels.index(self.breaks) if self.breaks is not None else len(self.ladder.levels)
        ends = (self.holds, self.ladder.levels[above - 1] if above else None)
        low, high = (-math.inf if level is None else self._severity(level) for level in ends)
        return low, high

    def _ends_of(self, other: object) -> _Ends | None:
        if isinstance(other, Bracket):
            return other._ends()
        if isinstance(other, Perturbation):
            other = self.ladder.level_of(other)
        return (self._severity(other), self._severity(other)) if isinstance(other, (int, float)) else None

    def _severity(self, level: float) -> float:
        """Return a number that grows with severity; a ladder of one level follows the failure's own steps."""
        falls = len(self.ladder.levels) == 1 and _way(self.ladder) < 0
        return -self.ladder.severity(level) if falls else self.ladder.severity(level)

    def _mild_first(self) -> list[SeverityProbe]:
        return sorted(self.probes, key=lambda probe: self.ladder.severity(probe.level))


def largest(
    ladder: Ladder, decide: Decide, *, routes: int, metric: Metric | str, limit: float, comparison: str | None = None
) -> Bracket:
    """Return the bracket within which `metric comparison limit` stops to hold as the severity grows.

    With 20 `routes` or more, each severity is judged from evidence with margin 0, which stops as soon as the verdict is
    reached; an undecided severity sends the search to the side on which its value lies. With fewer routes, or for a
    user's metric, the value over all routes is compared with the limit. Only the answers decide which severities are
    tried, not the episodes already driven; those are not driven again.

    `comparison` defaults to `"<="` for metrics of which less is better, else to `">="`. Raises `PerturbationError` for
    levels that begin with the most severe, `RequirementError` for a metric or a limit that no requirement can have, and
    `ComparisonError` when a severity cannot be judged.
    """
    _require_mild_first(ladder)
    known = metric if isinstance(metric, Metric) else known_metric(metric)
    compares = comparison or (">=" if known.higher_is_better else "<=")
    rule: SearchRule = "evidence" if routes >= FEWEST_FOR_T and known.function is None else "point"
    verdict_rule = VerdictRule(rule, margin=_NO_MARGIN, alpha=ALPHA)

    def requirement(level: float) -> Requirement:
        return Requirement(known, Setting.of(ladder.at(level)), compares, limit)

    def ask(level: float) -> SeverityProbe:
        return _probe(level, decide(requirement(level), verdict_rule))

    probes = bisect(ladder, ask)
    warnings = (*contradictions(ladder, known, probes), *_reasons(ladder, probes))
    return Bracket(ladder, known, compares, requirement(ladder.levels[0]).limit, rule, ALPHA, probes, warnings)


def _way(ladder: Ladder) -> int:
    """Return 1 if the ladder that the failure declares rises, -1 if the ladder falls, 0 if it has one step."""
    declared = type(ladder.template).ladder
    steps = (0.0, 1.0) if declared is None or declared[1] == "ticks" else tuple(declared[1])
    return (steps[-1] > steps[0]) - (steps[-1] < steps[0])


def _require_mild_first(ladder: Ladder) -> None:
    first, last = ladder.levels[0], ladder.levels[-1]
    if _way(ladder) * (last - first) < 0.0:
        raise PerturbationError(
            f"the levels of {ladder.name} lead from {ladder.label(first)} to {ladder.label(last)}, expected from mild "
            f"to severe: {'up' if _way(ladder) > 0 else 'down'}, as its own steps do. Turn them round."
        )


def bisect(ladder: Ladder, ask: Callable[[float], SeverityProbe]) -> tuple[SeverityProbe, ...]:
    """Try levels until two neighbours lie on different sides of the limit; return the probes in the order of trying.

    Bisection finds one crossing and supposes that there is no other (see `contradictions`).
    """
    below, above = -1, len(ladder.levels)
    probes = []
    while above - below > 1:
        middle = (below + above) // 2
        probes.append(ask(ladder.levels[middle]))
        goes_up = probes[-1].answer == "holds" or (probes[-1].answer == "undecided" and probes[-1].meets)
        below, above = (middle, above) if goes_up else (below, middle)
    return tuple(probes)


def contradictions(ladder: Ladder, metric: Metric, probes: Iterable[SeverityProbe]) -> tuple[str, ...]:
    """Return a warning if a milder severity is clearly worse than a more severe one: crossings may be several."""
    ordered = sorted(probes, key=lambda probe: ladder.severity(probe.level))
    sign = 1.0 if metric.higher_is_better else -1.0
    for mild, severe in pairwise(ordered):
        if sign * (severe.value - mild.value) > _NOTABLE * metric.span:
            return (
                f"not monotonic: {metric} {metric.format(mild.value)} at {ladder.label(mild.level)} but "
                f"{metric.format(severe.value)} at {ladder.label(severe.level)}: there may be more than one crossing.",
            )
    return ()


def _reasons(ladder: Ladder, probes: Iterable[SeverityProbe]) -> Iterable[str]:
    """Return the reasons of undecided severities that more routes would not decide."""
    ordered = sorted(probes, key=lambda probe: ladder.severity(probe.level))
    open_ = [probe for probe in ordered if probe.answer == "undecided" and probe.reason]
    return [f"undecided at {ladder.label(probe.level)}: {probe.reason}" for probe in open_]


def _probe(level: float, verdict: Verdict) -> SeverityProbe:
    answer = _ANSWERS.get(verdict.decision, "undecided")
    meets = verdict.requirement.is_met_by(verdict.value)
    return SeverityProbe(level, answer, verdict.value, meets, verdict.routes, verdict.reason)
