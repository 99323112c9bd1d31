"""A measured value that a test compares with a number of its own."""

from __future__ import annotations

import math

from pytest_drive_robust.report.numbers import beside, counted, interval_text
from pytest_drive_robust.verdict.evaluate import Verdict

_DECIMALS = 9
_ROUNDING = 1e-12
"""Floating-point error to round away: 1 - 70 / 100 gives 0.30000000000000004, which must pass `<= 0.30`."""


class Estimate(float):
    """A measured value that compares like a float and shows its interval: `assert drive.rd(setting) <= 0.30`."""

    metric: str
    setting: str
    low: float
    high: float
    routes: int
    seeds: int

    @classmethod
    def of(cls, verdict: Verdict) -> Estimate:
        """Return the value of a verdict without floating-point error: `<= 0.30` agrees with a requirement `<= 0.30`."""
        short = round(verdict.value, _DECIMALS)
        estimate = cls(short if math.isclose(short, verdict.value, rel_tol=0.0, abs_tol=_ROUNDING) else verdict.value)
        estimate.metric = verdict.requirement.metric.name
        estimate.setting = str(verdict.requirement.setting)
        estimate.low, estimate.high = float(verdict.low), float(verdict.high)
        estimate.routes, estimate.seeds = verdict.routes, verdict.seeds
        return estimate

    def __repr__(self) -> str:
        interval = interval_text(self.metric, self.low, self.high)
        short, exact = f"{float(self):.2f}", f"{float(self):.4f}"  # 0.3004 <= 0.3 fails, which "0.30 <= 0.3" hides
        value = exact if float(exact) != float(short) else beside(self, float(short))  # 0.30001 takes five
        return (
            f"{value} ({self.metric} under {self.setting}, {interval}, "
            f"{counted(self.routes, 'route')} x {counted(self.seeds, 'seed')})"
        )
