"""Intervals that stay honest after an early stop: every threshold against which betting has not won.

A fixed-n interval of a run that stopped because it looked clear is too sure. Wealth is not: whatever the rule by which
the reading stopped, wealth against the truth is 1 / alpha or more with a chance of alpha at most. So the thresholds
with less wealth than that hold the truth with a chance of 1 - alpha a side. Wealth at a threshold grows with the
distance to it, so the ends are found by bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.stats.evidence import EARLY_SHARE, FEWEST_FOR_T, mean_below_zero_p

__all__ = ["evidence_interval", "mean_evidence_interval"]
