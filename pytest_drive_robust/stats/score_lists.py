"""The verdict on two lists of driving scores, without pytest, suites or agents."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.evidence import Decision, degradation_forms
from pytest_drive_robust.stats.judges import EvidenceJudge


class GateVerdict(NamedTuple):
    """The verdict of `gate` and the number of pairs read for it."""

    verdict: Decision
    pairs: int


def gate(
    clean: Iterable[float], perturbed: Iterable[float], threshold: float, margin: float = 0.10, alpha: float = 0.05
) -> GateVerdict:
    """Judge whether RD = 1 - mean(perturbed) / mean(clean) is at most `threshold`, on driving scores 0..100 per route.

    `clean` and `perturbed` give one score per route each, in planned order; average the seeds of a route first.
    "fail": RD exceeds `threshold`; "pass": RD stays below threshold + margin; each is wrong at most `alpha` of the
    time. Fewer than 20 routes are judged by betting alone. A clean score of 0 on all routes is inconclusive. The lists
    may also be two runs of one setting, so `gate` has no floor of the clean score: the caller has one (`VerdictRule`).

    >>> gate([90.0] * 30, [88.0] * 30, threshold=0.30)
    GateVerdict(verdict='pass', pairs=14)
    >>> gate([90.0] * 30, [20.0] * 30, threshold=0.30).verdict
    'fail'

    Raises `ComparisonError` for scores outside 0..100, lists of different lengths or no pair, `ValueError` for a
    threshold, margin or alpha that leaves nothing to decide.
    """
    judge = EvidenceJudge(degradation_forms(threshold, margin), alpha=alpha)
    for before, after in list(_pairs(clean, perturbed)):  # a list, so that pairs after the verdict are checked too
        if judge.read(after, before) is not None:
            break
    return GateVerdict(judge.close(), judge.routes)


def _pairs(clean: Iterable[float], perturbed: Iterable[float]) -> Iterable[tuple[float, float]]:
    try:
        for before, after in zip(clean, perturbed, strict=True):
            for score in (before, after):
                if not 0.0 <= score <= 100.0:
                    raise ComparisonError(f"a driving score is {score!r}, expected a number in 0..100.")
            yield float(before), float(after)
    except ValueError:
        raise ComparisonError("clean and perturbed scores do not pair. Expected one of each per route.") from None
