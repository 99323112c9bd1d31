"""Rules that people use and that break the promise: the study must notice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import stdtr


def point_rule(
    clean: Sequence[float], perturbed: Sequence[float], threshold: float, margin: float, alpha: float
) -> tuple[str, int]:
    """RD of this run against the threshold."""
    return ("pass" if sum(perturbed) >= (1.0 - threshold) * sum(clean) else "fail"), len(clean)


def peeking_rule(
    clean: Sequence[float], perturbed: Sequence[float], threshold: float, margin: float, alpha: float
) -> tuple[str, int]:
    """A t test after every ten pairs until it is significant."""
    before, after = np.asarray(clean), np.asarray(perturbed)
    for used in range(10, len(before) + 1, 10):
        for keep, sign, verdict in ((1.0 - threshold, -1.0, "fail"), (1.0 - threshold - margin, 1.0, "pass")):
            gain = sign * (after[:used] - keep * before[:used])
            spread = max(float(gain.std(ddof=1)), 1e-9)
            if stdtr(used - 1, -gain.mean() / spread * np.sqrt(used)) <= alpha:
                return verdict, used
    return "inconclusive", len(before)
