"""A requirement: metric, setting, comparison, limit, for example `"RD under 200 ms latency <= 0.30"`.

A requirement gives `stats` two linear forms of one route's scores, and the margin of a rule in the metric's unit.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple, NoReturn

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.ladder import ladder_of
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.perturbations.sentences import brackets
from pytest_drive_robust.stats.evidence import LinearForms
from pytest_drive_robust.stats.resolution import USUAL_NOISE, Advice, advise
from pytest_drive_robust.verdict.known_metrics import known_metric
from pytest_drive_robust.verdict.limits import DIGITS, checked_limit, lenient_limit, linear_forms

if TYPE_CHECKING:
    from typing_extensions import Self

ANY_TICK_S = 0.05
"""A tick length in seconds for ladders that are built for their field and unit; its value has no effect there."""

_ROUNDING = 1e-9
"""The share of a metric's range that counts as rounding: 1 - 70 / 100 is 0.30000000000000004 and meets 0.30."""
_COMPARISONS = ("<=", ">=")


class Written(NamedTuple):
    """The sentence of a requirement, and its line, from 1, in the file `path`, or in a text when `path` is None.

    `path` is absolute, because a test may change the folder before its failure is reported.
    """

    path: Path | None
    line: int
    sentence: str


@dataclass(frozen=True, init=False)
class Requirement:
    """A requirement on an agent; judged by `evaluate.evaluate`.

    `metric` is RD, DS (0..100), SR (0..1), efficiency or comfort (percent) or a registered metric, or its name.
    `setting` is a stack or one perturbation. `comparison` is `"<="` or `">="`; a value equal to the limit passes.
    `str()` returns the sentence that `sentences.requirements` reads.

    Raises `RequirementError` for an unknown metric, a `setting` that is none, a limit outside the metric's range, and
    requirements that cannot fail: RD under clean, DS >= 0, SR <= 1.
    """

    metric: Metric
    setting: Setting
    comparison: str
    limit: float

    written: ClassVar[Written | None] = None
    """The sentence that `requirements` read the object from; not part of equality."""

    def __init__(self, metric: Metric | str, setting: Setting | Perturbation, comparison: str, limit: float) -> None:
        metric = metric if isinstance(metric, Metric) else known_metric(metric)
        setting = as_setting(setting)
        if comparison not in _COMPARISONS:
            raise RequirementError(f"{comparison!r} compares nothing. Expected '<=' or '>='.")
        limit = checked_limit(metric, comparison, limit)
        if metric.needs_clean and setting == setting.baseline:
            raise RequirementError(
                f"{metric} under {setting} is always 0, because {metric} compares with {setting.baseline}. "
                f"Name a perturbation ('{metric} under 200 ms latency {comparison} 0.30') or ask for a "
                "driving score ('DS under clean >= 60')."
            )
        for name, value in (("metric", metric), ("setting", setting), ("comparison", comparison), ("limit", limit)):
            object.__setattr__(self, name, value)

    def __hash__(self) -> int:
        return hash(str(self))  # perturbations are mutable, so the fields have no hash

    def __str__(self) -> str:
        return f"{self.metric} under {self.setting} {self.comparison} {self.metric.format_limit(self.limit)}"

    def __bool__(self) -> NoReturn:
        raise RequirementError(
            f"'{self}' is a requirement, not yet a verdict. Judge it with drive.check(...) instead of asserting it."
        )

    @property
    def id(self) -> str:
        """A test id of `A-Z a-z 0-9 _ . -`: `"rd-200ms-latency-le-0.30"`, different for different requirements."""
        comparison = "le" if self.comparison == "<=" else "ge"
        limit = self.metric.format_limit(self.limit)
        return f"{_slug(self.metric.name)}-{_slug(str(self.setting))}-{comparison}-{_slug(limit)}"

    def read_as(self, reading: DriveReading | None) -> Self:
        """Return this requirement with its failures read by `reading`; unchanged when `reading` is None.

        Raises `PerturbationError` for a switch whose stated value contradicts the reading.
        """
        if reading is None:
            return self
        made = type(self)(self.metric, self.setting.read_as(reading), self.comparison, self.limit)
        object.__setattr__(made, "written", self.written)
        return made

    @property
    def needs_clean(self) -> bool:
        """True when the requirement needs clean episodes to be judged."""
        return self.metric.needs_clean

    def is_met_by(self, value: float) -> bool:
        """Return True when `value` is on the right side of the limit, or equal to the limit up to rounding."""
        rounding = _ROUNDING * self.metric.span
        return value <= self.limit + rounding if self.comparison == "<=" else value >= self.limit - rounding

    def reads_routes(self, verdict_rule: VerdictRule) -> bool:
        """Return True when the verdict reads route by route; a metric by a user's function over all episodes cannot."""
        return verdict_rule.kind != "point" and self.metric.function is None

    def margin(self, verdict_rule: VerdictRule) -> float:
        """Return how far beyond the limit a pass from evidence may reach, in the unit of the metric.

        The margin is that of `verdict_rule`, cut near an end of the metric's range, see `lenient_limit`.
        """
        return round(abs(self.lenient_limit(verdict_rule) - self.limit), DIGITS)

    def lenient_limit(self, verdict_rule: VerdictRule) -> float:
        """Return the limit beyond which a pass from evidence does not reach: the limit with the margin added."""
        return lenient_limit(self.metric, self.comparison, self.limit, verdict_rule)

    def linear_forms(self, verdict_rule: VerdictRule) -> LinearForms:
        """Return the linear forms of one route's scores that the judges of `stats` read."""
        return linear_forms(self.metric, self.comparison, self.limit, verdict_rule)

    def advice(self, verdict_rule: VerdictRule, routes: int) -> Advice:
        """Return the advice on what `routes` routes can show at the usual noise; `"fine"` unless by evidence."""
        if verdict_rule.kind != "evidence" or not self.reads_routes(verdict_rule):
            return Advice("fine", "")
        span = self.metric.span
        noise, margin = USUAL_NOISE * span, verdict_rule.margin * span
        return advise(routes, margin, noise, what=self.metric.name, scale=span, alpha=verdict_rule.alpha)


class MarginRequirement(Requirement):
    """A severity of one failure that the agent must survive: `latency margin >= 150 ms (RD <= 0.30)`.

    Means the requirement at that severity, `RD under 150 ms latency <= 0.30`, and is judged by the same rule. When the
    requirement is not met, the message says how far the agent gets (`drive.largest`). Other parameters of the failure
    have their defaults; different values follow in the brackets: `latency margin >= 150 ms (RD <= 0.30, mode=hold)`.
    """

    @property
    def perturbation(self) -> Perturbation:
        """The failure at the severity that must be survived."""
        return self.setting.perturbations[0]

    @property
    def id(self) -> str:
        """A test id: `"latency-margin-ge-150ms-rd-le-0.30"`."""
        return _slug(str(self).replace(">=", "ge").replace("<=", "le"))

    def __str__(self) -> str:
        ladder = ladder_of(self.perturbation, dt_s=ANY_TICK_S)
        level = ladder.label(ladder.level_of(self.perturbation))
        limit = self.metric.format_limit(self.limit)
        others = "".join(f", {unusual}" for unusual in [brackets(self.perturbation, without=ladder.field)] if unusual)
        return f"{ladder.word} margin >= {level} ({self.metric} {self.comparison} {limit}{others})"


def as_setting(given: Setting | Perturbation) -> Setting:
    """Return a perturbation as a setting, and a setting as it is. Raises `RequirementError` for anything else."""
    if isinstance(given, Perturbation):
        return Setting.of(given)
    if not isinstance(given, Setting):
        raise RequirementError(
            f"{given!r} is not a setting. Expected a perturbation such as InferenceLatency(ms=200), a stack of them "
            "('+'), or a sentence parsed by Setting.parse."
        )
    return given


def by_evidence(requirements: Sequence[Requirement], verdict_rule: VerdictRule) -> int:
    """Return how many verdicts from evidence a test with `requirements` gives; 1 when the requirements are unknown."""
    if verdict_rule.kind != "evidence":
        return 0
    return sum(item.reads_routes(verdict_rule) for item in requirements) if requirements else 1


def _slug(text: str) -> str:
    """Return a part of a test id: `"GPS noise 5 m"` to `"gps-noise-5m"`."""
    text = re.sub(r"(?<=\d) (?=(?:ms|m|s)\b)", "", text.lower())
    text = re.sub(r"(?<![a-z0-9.])-(?=\d)", "minus ", text)
    return re.sub(r"[^a-z0-9_.]+", "-", text.replace("e+", "e")).strip("-")
