"""A requirement: metric, setting, comparison, limit. `"RD under 200 ms latency <= 0.30"` is one."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import NoReturn

from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.verdict.known import known_metric

__all__ = ["Requirement", "Unjudged", "requirement", "slug"]


@dataclass(frozen=True)
class Requirement:
    """What must hold for an agent; judged by `evaluate.judge`.

    `metric` is RD, DS (0..100), SR (0..1), efficiency or comfort (percent) or a registered one, `comparison` is `"<="`
    or `">="`, a value equal to the limit passes. `str()` is the sentence that `parse_requirement` reads.

    Raises `RequirementError` for an unknown metric, a limit outside the metric's range, and for requirements that
    cannot fail: RD under clean, DS >= 0, SR <= 1.
    """

    metric: str
    setting: Setting
    comparison: str
    limit: float

    def __post_init__(self) -> None:
        metric = known_metric(self.metric)
        if self.comparison not in ("<=", ">="):
            raise RequirementError(f"{self.comparison!r} compares nothing. Expected '<=' or '>='.")
        object.__setattr__(self, "limit", _checked_limit(metric, self.comparison, self.limit))
        if metric.needs_clean and self.setting == self.setting.baseline:
            raise RequirementError(
                f"{self.metric} under {self.setting} is always 0, because it compares with {self.setting.baseline}. "
                f"Name a perturbation ('{self.metric} under 200 ms latency {self.comparison} 0.30') or ask for a "
                "driving score ('DS under clean >= 60')."
            )

    def __hash__(self) -> int:
        return hash(str(self))  # perturbations are mutable, so the fields have no hash

    def __str__(self) -> str:
        limit = known_metric(self.metric).format_limit(self.limit)
        return f"{self.metric} under {self.setting} {self.comparison} {limit}"

    def __bool__(self) -> NoReturn:
        raise RequirementError(
            f"'{self}' is a requirement, not yet a verdict. Judge it with drive.check(...) instead of asserting it."
        )

    @property
    def id(self) -> str:
        """A test id of `A-Z a-z 0-9 _ . -`: `"rd-200ms-latency-le-0.30"`, different for different requirements."""
        comparison = "le" if self.comparison == "<=" else "ge"
        limit = known_metric(self.metric).format_limit(self.limit)
        return f"{slug(self.metric)}-{slug(str(self.setting))}-{comparison}-{slug(limit)}"

    @property
    def needs_clean(self) -> bool:
        """True when the clean episodes must be driven to judge it."""
        return known_metric(self.metric).needs_clean

    def is_met_by(self, value: float) -> bool:
        """True when `value` is on the right side of the limit or equal to it."""
        return value <= self.limit if self.comparison == "<=" else value >= self.limit


@dataclass(frozen=True)
class Unjudged:
    """A metric under a setting that waits for its limit: `requirement("RD", InferenceLatency(ms=200)) <= 0.30`."""

    metric: str
    setting: Setting

    def __le__(self, limit: float) -> Requirement:
        return Requirement(self.metric, self.setting, "<=", limit)

    def __ge__(self, limit: float) -> Requirement:
        return Requirement(self.metric, self.setting, ">=", limit)

    def __bool__(self) -> NoReturn:
        raise RequirementError(f"'{self.metric} under {self.setting}' has no limit yet. Add '<= limit' or '>= limit'.")


def requirement(metric: str, setting: Setting | Perturbation = Setting.CLEAN) -> Unjudged:
    """The object form of a sentence: `requirement("RD", InferenceLatency(ms=200)) <= 0.30`.

    Raises `RequirementError` for an unknown metric; the limit is checked when it is compared with.
    """
    known_metric(metric)
    if isinstance(setting, Perturbation):
        return Unjudged(metric, Setting.of(setting))
    if not isinstance(setting, Setting):
        raise RequirementError(
            f"{setting!r} is no setting. Expected a perturbation such as InferenceLatency(ms=200), a stack of them "
            "('+'), or a sentence parsed by Setting.parse."
        )
    return Unjudged(metric, setting)


def _checked_limit(metric: Metric, comparison: str, limit: float) -> float:
    """The limit as a float that the metric can reach and can miss."""
    try:
        number = float(limit)
    except (TypeError, ValueError):
        raise RequirementError(f"the limit of {metric.name} is {limit!r}, expected a number.") from None
    # RD has no lower end, but a perturbed score of twice the clean one is a mistake in the sentence, not a wish.
    low, high = (-1.0, 1.0) if metric.needs_clean else (metric.low, metric.high)
    if not math.isfinite(number) or not low <= number <= high:
        raise RequirementError(f"the limit of {metric.name} is {number:g}, expected {_range(low, high)}.")
    if metric.needs_clean and number == low:
        raise RequirementError(f"the limit of {metric.name} is {number:g}, expected a number above {low:g}.")
    always = metric.high if comparison == "<=" else metric.low
    if number == always:
        raise RequirementError(
            f"{metric.name} {comparison} {number:g} holds for every agent, so it can never fail. "
            f"Expected a limit {'below' if comparison == '<=' else 'above'} {number:g}."
        )
    return number + 0.0  # -0.0 would print as "-0"


def _range(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "a finite number"
    return f"{low:g} or more" if math.isinf(high) else f"a number in {low:g}..{high:g}"


def slug(text: str) -> str:
    """A part of a test id: `"GPS noise 5 m"` to `"gps-noise-5m"`."""
    text = re.sub(r"(?<=\d) (?=(?:ms|m|s)\b)", "", text.lower())
    text = re.sub(r"(?<![a-z0-9.])-(?=\d)", "minus ", text)
    return re.sub(r"[^a-z0-9_.]+", "-", text.replace("e+", "e")).strip("-")
