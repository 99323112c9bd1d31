"""Corrects for several verdicts in one run.

"All requirements hold" needs no correction: this statement is wrong at most alpha of the time, because one wrong pass
is already that rare. "Something failed" is wrong more often the more requirements sit exactly at their limits:
`any_wrong` computes the worst case, and Holm's procedure bounds it.

Holm's procedure needs all p-values, but a test needs its verdict at once. So among `family` requirements a verdict is a
fail at once when its p-value is alpha / family at most, Holm's strictest step, which later p-values cannot revoke.
Other verdicts wait as inconclusive, and `late_fails` returns at the end the waiting verdicts that Holm rejects too.
"""

from __future__ import annotations

from collections.abc import Sequence


def any_wrong(alpha: float, count: int) -> float:
    """Return the chance that at least one of `count` independent verdicts at their limits fails wrongly.

    >>> round(any_wrong(0.05, 11), 2)
    0.43
    """
    return float(1.0 - (1.0 - alpha) ** count)


def holm(p_values: Sequence[float], alpha: float = 0.05) -> tuple[bool, ...]:
    """Return which hypotheses "it holds" are rejected, so that any wrong rejection has a chance of `alpha` at most.

    Source: Holm 1979, "A simple sequentially rejective multiple test procedure". No independence is needed, so a clean
    run may be shared.

    >>> holm([0.010, 0.030, 0.020, 0.800])
    (True, False, False, False)

    Raises `ValueError` for a p-value outside 0..1.
    """
    for p_value in p_values:
        if not 0.0 <= p_value <= 1.0:
            raise ValueError(f"a p-value is {p_value!r}, expected a number in 0..1.")
    rejected = [False] * len(p_values)
    for rank, index in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        if p_values[index] > alpha / (len(p_values) - rank):
            break
        rejected[index] = True
    return tuple(rejected)


def late_fails(
    verdicts: Sequence[str], p_values: Sequence[float], *, family: int, alpha: float = 0.05
) -> tuple[int, ...]:
    """Return the places of the inconclusive verdicts that Holm's procedure makes fails, once all verdicts are known.

    Missing p-values are filled up to `family` with 1: an unjudged requirement rejects nothing. A pass counts as 1 too.

    >>> late_fails(["fail", "inconclusive", "inconclusive", "pass"], [0.001, 0.016, 0.04, 0.7], family=4)
    (1,)
    """
    ranked = [1.0 if verdict == "pass" else p_value for verdict, p_value in zip(verdicts, p_values, strict=True)]
    rejected = holm([*ranked, *([1.0] * (family - len(ranked)))], alpha)
    return tuple(place for place, verdict in enumerate(verdicts) if verdict == "inconclusive" and rejected[place])
