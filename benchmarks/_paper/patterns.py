"""Test whether the driven episodes show seven patterns of the paper's table, in one of the readings.

A pattern consists of *parts*, each the difference of two figures with its 95 % interval, positive where the pattern
holds. A part appears when the whole interval lies above its threshold (0, or `FAR` for "far more"), does not appear
when the whole interval lies at or below the threshold, and is undecided otherwise. A pattern appears when all parts
appear, and does not appear when one part does not. For rankings one part (a pair of agents) is enough to appear, and
the intervals are wider, so that all of them together are wrong 5 % of the time.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Literal

from _paper.estimates import IntervalEstimate, ds_means, efficiency_means, gap, rd_means
from _paper.published import AGENTS, CLEAN, FAMILIES, PUBLISHED, SETTINGS, SHORT, published_average
from _paper.readings import Drives

__all__ = ["FAR", "Pattern", "PatternPart", "Verdict", "all_of", "any_of", "judge", "patterns_of"]

Verdict = Literal["appears", "does not appear", "cannot be told", "not driven"]

FAR = 0.20
"""Threshold of "far more", in RD. The paper's differences under GPS noise of 15 m are 0.57 to 0.67."""

CAPPED = ("tcp", "uniad")
"""The agents that cut their throttle above a measured speed (`drive_robust_agents/_wrappers/tuning.py`)."""

REFERENCE = "simlingo"
"""The agent with which two of the patterns compare the other agents."""

_MILD, _SEVERE = FAMILIES["latency"][0], FAMILIES["latency"][-1]


@dataclass(frozen=True, slots=True)
class PatternPart:
    """One comparison, shown in the columns of `agents`; `paper` is its value in the paper's table."""

    agents: tuple[str, ...]
    what: str
    estimate: IntervalEstimate | None
    paper: float
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Pattern:
    """A statement about the paper's table; `key` names its explanation, `how` explains how to read its parts."""

    key: str
    statement: str
    unit: str
    parts: tuple[PatternPart, ...]
    verdict: Verdict
    how: str = ""
    digits: int = 2
    interval: str = "95 % interval"

    def verdict_of(self, agent: str) -> Verdict | None:
        """Return the verdict of all parts of one agent; None when the pattern has no part of this agent."""
        own = [part.verdict for part in self.parts if agent in part.agents]
        return all_of(own) if own else None


def judge(estimate: IntervalEstimate | None, needs: float = 0.0) -> Verdict:
    """Return the verdict of an interval on "more than `needs`"; an interval of the single point `needs` is not more."""
    if estimate is None:
        return "not driven"
    if estimate.low > needs:
        return "appears"
    return "does not appear" if estimate.high <= needs else "cannot be told"


def all_of(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the verdict on a statement that holds when every part holds; a missing drive leaves it undecided."""
    return _together(verdicts, decisive="does not appear", otherwise="appears")


def any_of(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the verdict on a statement that holds when one part does."""
    return _together(verdicts, decisive="appears", otherwise="does not appear")


def _together(verdicts: Iterable[Verdict], *, decisive: Verdict, otherwise: Verdict) -> Verdict:
    seen = set(verdicts)
    if decisive in seen:
        return decisive
    if seen == {otherwise}:
        return otherwise
    return "not driven" if seen <= {"not driven"} else "cannot be told"


def patterns_of(drives: Drives) -> tuple[Pattern, ...]:
    """Return all seven patterns in one reading; the last pattern judges pairs of agents, the others single agents."""
    return (
        _all("severity", "RD rises with severity in every family", _severity(drives)),
        _all("latency", "Latency of 500 ms hurts every agent more than 100 ms", _latency(drives)),
        _all(
            "gps",
            "GPS noise of 15 m hurts TCP, UniAD and VAD far more than SimLingo",
            _gps(drives),
            how=f"Far more: the interval lies above {FAR:.2f}.",
        ),
        _all("occlusion", "Occlusion 0.8 hurts more than 0.5, and hurts SimLingo most", _occlusion(drives)),
        _all(
            "burst",
            "Burst is the mildest camera failure",
            _burst(drives),
            how="The mean over both severities of occlusion against that of burst.",
        ),
        _all(
            "speed",
            "Speed underestimation raises the efficiency of the throttle-capped agents",
            _speed(drives),
            how=f"Capped above a measured speed: {' and '.join(CAPPED)}. Over the routes with data in both runs.",
            unit="efficiency, points",
            digits=1,
        ),
        _ranking(drives),
    )


def _all(
    key: str, statement: str, parts: list[PatternPart], *, how: str = "", unit: str = "RD", digits: int = 2
) -> Pattern:
    """Return a pattern that appears when all its parts appear."""
    return Pattern(key, statement, unit, tuple(parts), all_of(part.verdict for part in parts), how, digits)


def _rd_gap(
    drives: Drives, more: tuple[str, tuple[str, ...]], less: tuple[str, tuple[str, ...]]
) -> IntervalEstimate | None:
    """Return the mean RD of `more` (agent, settings) minus the mean RD of `less`."""
    return gap(rd_means(drives, *more), rd_means(drives, *less))


def _paper_rd(agent: str, settings: tuple[str, ...]) -> float:
    return published_average(agent, settings).rd


def _within(drives: Drives, agent: str, more: tuple[str, ...], less: tuple[str, ...], what: str) -> PatternPart:
    """Compare RD under some settings with RD under others, for one agent."""
    estimate = _rd_gap(drives, (agent, more), (agent, less))
    return PatternPart((agent,), what, estimate, _paper_rd(agent, more) - _paper_rd(agent, less), judge(estimate))


def _step(drives: Drives, agent: str, mild: str, severe: str) -> PatternPart:
    return _within(drives, agent, (severe,), (mild,), f"{agent}: {SHORT[severe]} - {SHORT[mild]}")


def _severity(drives: Drives) -> list[PatternPart]:
    return [
        _step(drives, agent, mild, severe)
        for agent in AGENTS
        for family in FAMILIES.values()
        for mild, severe in pairwise(family)
    ]


def _latency(drives: Drives) -> list[PatternPart]:
    return [_step(drives, agent, _MILD, _SEVERE) for agent in AGENTS]


def _gps(drives: Drives) -> list[PatternPart]:
    severe = FAMILIES["GPS"][-1:]
    parts = []
    for agent in AGENTS:
        if agent != REFERENCE:
            estimate = _rd_gap(drives, (agent, severe), (REFERENCE, severe))
            what = f"{agent} - {REFERENCE}: {SHORT[severe[0]]}, more than {FAR:.2f}"
            paper = _paper_rd(agent, severe) - _paper_rd(REFERENCE, severe)
            parts.append(PatternPart((agent,), what, estimate, paper, judge(estimate, FAR)))
    return parts


def _occlusion(drives: Drives) -> list[PatternPart]:
    mild, severe = FAMILIES["occlusion"]
    parts = [_step(drives, agent, mild, severe) for agent in AGENTS]
    for agent in AGENTS:
        if agent != REFERENCE:
            estimate = _rd_gap(drives, (REFERENCE, (severe,)), (agent, (severe,)))
            paper = _paper_rd(REFERENCE, (severe,)) - _paper_rd(agent, (severe,))
            what = f"{REFERENCE} - {agent}: {SHORT[severe]}"
            parts.append(PatternPart((REFERENCE,), what, estimate, paper, judge(estimate)))
    return parts


def _burst(drives: Drives) -> list[PatternPart]:
    more, less = FAMILIES["occlusion"], FAMILIES["burst"]
    what = "mean of occlusion - mean of burst"
    return [_within(drives, agent, more, less, f"{agent}: {what}") for agent in AGENTS]


def _speed(drives: Drives) -> list[PatternPart]:
    parts = []
    for agent in CAPPED:
        for setting in FAMILIES["speed"]:
            pair = efficiency_means(drives, agent, setting)
            estimate = None if pair is None else gap(pair[1], pair[0])
            paper = PUBLISHED[agent][setting].efficiency - PUBLISHED[agent][CLEAN].efficiency
            parts.append(PatternPart((agent,), f"{agent}: {SHORT[setting]} - clean", estimate, paper, judge(estimate)))
    return parts


def _ranking(drives: Drives) -> Pattern:
    """Judge for each pair of agents whether the one that drives better cleanly loses more under failures."""
    pairs = list(combinations(AGENTS, 2))
    confidence = 1.0 - 0.05 / len(pairs)
    parts = tuple(_reversal(drives, *pair, confidence) for pair in pairs)
    return Pattern(
        "ranking",
        "The ranking by clean DS differs from the ranking by RD",
        "mean RD of the eleven settings",
        parts,
        any_of(part.verdict for part in parts),
        how="One pair is enough: the better driver without failures loses more under them, and both are clear. The "
        "intervals are wider, so that all six together are wrong 5 % of the time.",
        interval=f"{100.0 * confidence:.1f} % interval",
    )


def _reversal(drives: Drives, first: str, second: str, confidence: float) -> PatternPart:
    """Judge one pair: the better agent's RD is clearly larger, and both DS and RD are clearly apart."""
    better, worse = first, second
    ahead = gap(ds_means(drives, first, CLEAN), ds_means(drives, second, CLEAN), confidence)
    if ahead is not None and ahead.value < 0.0:
        better, worse, ahead = second, first, IntervalEstimate(-ahead.value, -ahead.high, -ahead.low)
    lost = gap(rd_means(drives, better, SETTINGS), rd_means(drives, worse, SETTINGS), confidence)
    verdict = judge(lost)
    if ahead is not None and ahead.low <= 0.0 and verdict != "not driven":
        verdict = "cannot be told"
    what = f"{better} - {worse}"
    if ahead is not None:
        what += f" (clean DS {ahead.value:+.1f}, {ahead.low:+.1f} to {ahead.high:+.1f})"
    return PatternPart((), what, lost, _paper_rd(better, SETTINGS) - _paper_rd(worse, SETTINGS), verdict)
