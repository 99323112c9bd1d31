"""A requirement: metric, setting, comparison, limit, for example `"RD under 200 ms latency <= 0.30"`.

A requirement gives `stats` two linear forms of one route's scores, and the margin of a rule in the metric's unit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple, NoReturn

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import RequirementError, did_you_mean
from pytest_drive_robust.metrics.table import METRICS, Metric
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.ladder import ladder_of
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.perturbations.sentences import brackets, render_value
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.stats.evidence import LinearForms, degradation_forms, mean_forms
from pytest_drive_robust.stats.resolution import USUAL_NOISE, Advice, advise

if TYPE_CHECKING:
    from typing_extensions import Self

ANY_TICK_S = 0.05
"""A tick length in seconds for ladders that are built for their field and unit; its value has no effect there."""

_ROUNDING = 1e-9
"""The share of a metric's range that counts as rounding: 1 - 70 / 100 is 0.30000000000000004 and meets 0.30."""
_DIGITS = 12
"""The decimals of a limit or margin; further ones are rounding: 0.3 + 0.1 - 0.3 is 0.10000000000000003."""
_COMPARISONS = ("<=", ">=")


def known_metric(name: str) -> Metric:
    """Return the metric of that name. Raises `RequirementError` with the nearest name, or a broken plugin's error."""
    if name in METRICS:
        return METRICS[name]
    names = metric_names()
    if name not in names:
        hint = did_you_mean(str(name), names)
        raise RequirementError(f"there is no metric named {name!r}.{hint} Expected one of {', '.join(names)}.")
    return Metric.from_function(name, default_registry().metric(name))


def metric_names() -> list[str]:
    """Return every name that `known_metric` knows, the built-in ones first."""
    return [*METRICS, *(name for name, _ in default_registry().names("metrics") if name not in METRICS)]


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
        setting = _as_setting(setting)
        if comparison not in _COMPARISONS:
            raise RequirementError(f"{comparison!r} compares nothing. Expected '<=' or '>='.")
        limit = _checked_limit(metric, comparison, limit)
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
        return round(abs(self.lenient_limit(verdict_rule) - self.limit), _DIGITS)

    def lenient_limit(self, verdict_rule: VerdictRule) -> float:
        """Return the limit beyond which a pass from evidence does not reach: the limit with the margin added."""
        return lenient_limit(self.metric, self.comparison, self.limit, verdict_rule)

    def linear_forms(self, verdict_rule: VerdictRule) -> LinearForms:
        """Return the linear forms of one route's scores that the judges of `stats` read."""
        return _forms(self.metric, self.comparison, self.limit, verdict_rule)

    def advice(self, verdict_rule: VerdictRule, routes: int) -> Advice:
        """Return the advice on what `routes` routes can show at the usual noise; `"fine"` unless by evidence."""
        if verdict_rule.kind != "evidence" or not self.reads_routes(verdict_rule):
            return Advice("fine", "")
        span = self.metric.span
        noise, margin = USUAL_NOISE * span, verdict_rule.margin * span
        return advise(routes, margin, noise, what=self.metric.name, scale=span, alpha=verdict_rule.alpha)


def lenient_limit(metric: Metric, comparison: str, limit: float, verdict_rule: VerdictRule) -> float:
    """Return the limit with the margin added, which a pass from evidence is better than; cut at the end of the range.

    `DS >= 5` with a margin of 10 is judged against 2.5, because every agent is better than -5.
    """
    forms = _forms(metric, comparison, limit, verdict_rule)
    return round(1.0 - forms.lenient_keep if forms.relative else forms.lenient_base, _DIGITS)


def _forms(metric: Metric, comparison: str, limit: float, verdict_rule: VerdictRule) -> LinearForms:
    margin = verdict_rule.margin * metric.span
    if metric.needs_clean:
        return degradation_forms(limit, margin, comparison=comparison)
    return mean_forms(limit, comparison, margin=margin, low=metric.low, high=metric.high)


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
        others = "".join(f", {unusual}" for unusual in [brackets(self.perturbation)] if unusual)
        return f"{ladder.word} margin >= {level} ({self.metric} {self.comparison} {limit}{others})"


@dataclass(frozen=True)
class Unjudged:
    """A metric under a setting that waits for its limit: `requirement("RD", InferenceLatency(ms=200)) <= 0.30`."""

    metric: Metric
    setting: Setting

    def __le__(self, limit: float) -> Requirement:
        return Requirement(self.metric, self.setting, "<=", limit)

    def __ge__(self, limit: float) -> Requirement:
        return Requirement(self.metric, self.setting, ">=", limit)

    def __lt__(self, limit: float) -> NoReturn:
        raise RequirementError(f"'{self.metric} under {self.setting} < {limit}': '<' cannot be used here, write '<='.")

    def __gt__(self, limit: float) -> NoReturn:
        raise RequirementError(f"'{self.metric} under {self.setting} > {limit}': '>' cannot be used here, write '>='.")

    def __bool__(self) -> NoReturn:
        raise RequirementError(f"'{self.metric} under {self.setting}' has no limit yet. Add '<= limit' or '>= limit'.")


def requirement(metric: str, setting: Setting | Perturbation = Setting.CLEAN) -> Unjudged:
    """Return the object form of a sentence: `requirement("RD", InferenceLatency(ms=200)) <= 0.30`.

    Raises `RequirementError` for an unknown metric; the comparison with a limit checks the limit.
    """
    return Unjudged(known_metric(metric), _as_setting(setting))


def _as_setting(given: Setting | Perturbation) -> Setting:
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


def _checked_limit(metric: Metric, comparison: str, limit: float) -> float:
    """Return the limit as a float. Raises `RequirementError` if the metric cannot reach or cannot miss the limit."""
    try:
        number = float(limit)
    except (TypeError, ValueError, OverflowError):
        raise RequirementError(f"the limit of {metric.name} is {limit!r}, expected a number.") from None
    # RD has no lower end, but a perturbed score of twice the clean one is a mistake in the sentence, not a wish.
    low, high = (-1.0, 1.0) if metric.needs_clean else (metric.low, metric.high)
    if not math.isfinite(number) or not low <= number <= high:
        told = f"the limit of {metric.name} is {render_value(number)}"
        raise RequirementError(f"{told}, expected {_range(low, high)}.")
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


def _slug(text: str) -> str:
    """Return a part of a test id: `"GPS noise 5 m"` to `"gps-noise-5m"`."""
    text = re.sub(r"(?<=\d) (?=(?:ms|m|s)\b)", "", text.lower())
    text = re.sub(r"(?<![a-z0-9.])-(?=\d)", "minus ", text)
    return re.sub(r"[^a-z0-9_.]+", "-", text.replace("e+", "e")).strip("-")
