"""Judges one requirement from its episodes; refuses episodes that say nothing, or leaves the verdict inconclusive."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.episodes import require_scorable, values_by_route
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.metrics.summary import Summary, summarize
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.stats.evidence import fail_p_value
from pytest_drive_robust.stats.intervals import (
    evidence_interval,
    jackknife_interval,
    mean_evidence_interval,
    mean_interval,
    ratio_interval,
    share_interval,
)
from pytest_drive_robust.verdict.explain import WorstRoute, Yardstick, why_rd_says_nothing, worst_routes
from pytest_drive_robust.verdict.requirement import Requirement
from pytest_drive_robust.verdict.touched import require_touched

_SCORES = ("RD", "DS", "SR")
"""The metrics whose worst routes are those with the lowest driving scores."""

_LIST_ALPHA = 0.025
"""The alpha a side of the 95 % interval of a list that was not read to its end."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on `requirement` for `agent`, with its numbers.

    `decision` is `"pass"`, `"fail"` or `"inconclusive"` by `verdict_rule`; `margin` is the margin of the rule in the
    unit of the metric (0 for rules without a margin). `reason` says what the numbers do not show. `value` is the metric
    over the `routes` driven, of `planned` routes. `low..high` is the interval of `value` over routes like these: 95 %,
    or alpha a side of the rule when evidence was read; both hold after an early stop. An end is infinite where one
    route or an unsure clean score gives no bound. `p_value` tests "the requirement holds"; None unless evidence was
    read. `clean` is None when no clean episode was given. `worst` holds at most three routes, for people.
    `without_data` counts the `routes` that hold no data for the metric: value and interval are those of the others.
    """

    requirement: Requirement
    agent: str
    decision: str
    verdict_rule: VerdictRule
    margin: float
    reason: str
    planned: int
    value: float
    low: float
    high: float
    routes: int
    seeds: int
    clean: Summary | None
    perturbed: Summary
    worst: tuple[WorstRoute, ...]
    p_value: float | None = None
    without_data: int = 0

    @property
    def passed(self) -> bool:
        """True for `"pass"` only."""
        return self.decision == "pass"


Decide = Callable[[Requirement, VerdictRule], Verdict]
"""Returns the verdict on a requirement by a rule, after driving the missing episodes."""


def evaluate(
    requirement: Requirement,
    *,
    agent: str,
    clean: Sequence[EpisodeResult],
    perturbed: Sequence[EpisodeResult],
    mode: str = "bench2drive",
    verdict_rule: VerdictRule | None = None,
    decision: str | None = None,
    planned: int | None = None,
) -> Verdict:
    """Return the verdict on `requirement`. `perturbed` are the episodes under its setting (clean ones for `clean`).

    `decision` is the decision that `verdict_rule` reached while reading the routes (`stats.judges`). Without a
    `decision`, the value is compared with the limit, as the rule `"point"` does. `planned` is the number of routes
    that could have been read.

    `clean` may be empty unless the metric is relative to the clean episodes; given clean episodes are shown beside the
    perturbed ones. For a relative metric, `clean` are episodes under `requirement.setting.baseline`, which is the
    setting `clean` except for settings with a warm-up.

    An RD whose clean driving score is below the floor of the rule shows nothing: by any rule a pass becomes
    inconclusive, and a fail stays a fail. Raises `ComparisonError` when there is nothing to judge: no episode or no
    data for the metric, an `infra_error`, episodes of another agent or setting, a setting that changed nothing, sets
    that do not pair, a clean driving score of 0. Raises `UnknownNameError` for an unknown mode.
    """
    metric = requirement.metric
    _require_episodes_for(requirement, agent, clean=clean, perturbed=perturbed)
    value, (low, high) = measure(metric, clean=clean, perturbed=perturbed, mode=mode)
    routes = len({result.episode.route_id for result in perturbed})
    by_route = None if metric.function is not None else metric.by_route(perturbed, clean=clean, mode=mode)
    p_value = None
    if decision is None or verdict_rule is None:
        # Without reading route by route, no error rate can be promised.
        verdict_rule = replace(verdict_rule or VerdictRule(), kind="point")
        decision = "pass" if requirement.is_met_by(value) else "fail"
    elif by_route and (not (ended := planned is None or routes >= planned) or verdict_rule.kind == "evidence"):
        (low, high), p_value = _after_reading(requirement, verdict_rule, *by_route, ended=ended)
    reason = _below_floor(metric, clean, verdict_rule)
    decision = "inconclusive" if reason and decision == "pass" else decision
    yardstick = (
        None if decision == "pass" else yardstick_of(metric, requirement.comparison, requirement.limit, mode=mode)
    )
    return Verdict(
        requirement=requirement,
        agent=agent,
        decision=decision,
        verdict_rule=verdict_rule,
        margin=requirement.margin(verdict_rule) if verdict_rule.kind == "evidence" else 0.0,
        reason=reason,
        planned=routes if planned is None else planned,
        value=value,
        low=low,
        high=high,
        routes=routes,
        seeds=len({result.episode.seed for result in perturbed}),
        clean=summarize(clean, mode=mode) if clean else None,
        perturbed=summarize(perturbed, mode=mode),
        worst=worst_routes(clean, perturbed, relative=metric.needs_clean, yardstick=yardstick),
        p_value=p_value,
        without_data=routes - len(by_route[0]) if by_route else 0,
    )


def yardstick_of(metric: Metric, comparison: str, limit: float, *, mode: str) -> Yardstick | None:
    """Return the yardstick that ranks the routes of a broken requirement, or None when the driving score ranks them."""
    if metric.name in _SCORES:
        return None

    def value(result: EpisodeResult) -> float | None:
        try:
            found = metric.measure([result], mode=mode)
            return found if found is not None and math.isfinite(found) else None
        except (Exception, SystemExit):  # a user's function may need several episodes; the ranking is only information
            return None

    return Yardstick(value, limit, is_upper=comparison == "<=")


def _after_reading(
    requirement: Requirement,
    verdict_rule: VerdictRule,
    values: Sequence[float],
    references: Sequence[float],
    *,
    ended: bool,
) -> tuple[tuple[float, float], float | None]:
    """Return the interval and, by evidence, the p-value; both stay valid when reading stopped early."""
    metric, alpha, comparison = requirement.metric, _LIST_ALPHA, requirement.comparison
    p_value = None
    if verdict_rule.kind == "evidence":
        alpha = verdict_rule.alpha
        p_value = fail_p_value(requirement.linear_forms(verdict_rule), values, references, ended=ended)
    if metric.needs_clean:
        return evidence_interval(references, values, alpha, ended=ended, comparison=comparison), p_value
    low, high = metric.low, metric.high
    return mean_evidence_interval(values, alpha, low=low, high=high, ended=ended, comparison=comparison), p_value


def _below_floor(metric: Metric, clean: Sequence[EpisodeResult], verdict_rule: VerdictRule) -> str:
    """Return why a pass of an RD shows nothing, or an empty string."""
    if not metric.needs_clean:
        return ""
    scores = values_by_route(clean, driving_score).values()
    return why_rd_says_nothing(math.fsum(scores) / len(scores), verdict_rule.clean_floor)


def measure(
    metric: Metric, *, clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult], mode: str = "bench2drive"
) -> tuple[float, tuple[float, float]]:
    """Return the value of a metric and its 95 % interval (low, high); the unit of analysis is the route.

    Fieller for RD, Wilson for SR, Student's t for other means over episodes, jackknife for a user's function. Raises
    `ComparisonError` when the episodes hold no data for the metric, and for sets that the metric refuses.
    """
    value = metric.measure(perturbed, clean=clean, mode=mode)
    if value is None:
        raise ComparisonError(
            f"the {len(perturbed)} episodes under {perturbed[0].episode.setting!r} hold no data for {metric} "
            f"({metric.meaning}), so there is nothing to judge."
        )
    try:
        number = float(value) if isinstance(value, numbers.Real) else math.nan
    except OverflowError:  # a whole number beyond the floats
        number = math.inf
    if not math.isfinite(number):
        raise ComparisonError(f"the metric {metric} gave {value!r}, expected a finite number, or None for no data.")
    return number, _interval(metric, number, clean, perturbed, mode)


def _interval(
    metric: Metric, value: float, clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult], mode: str
) -> tuple[float, float]:
    bounds, function = (metric.low, metric.high), metric.function
    if function is None:
        values, references = metric.by_route(perturbed, clean=clean, mode=mode)
        if metric.needs_clean:
            return ratio_interval(references, values)
        return share_interval(values) if bounds == (0.0, 1.0) else mean_interval(values, bounds=bounds)
    routes = dict.fromkeys(result.episode.route_id for result in perturbed)
    if len(routes) < 2:
        return bounds
    try:
        without = [function([result for result in perturbed if result.episode.route_id != route]) for route in routes]
        known = [other for other in without if other is not None]
        return jackknife_interval(value, known, bounds=bounds) if len(known) == len(without) else bounds
    except (Exception, SystemExit):  # a user's function may need more routes; the interval is only information
        return bounds


def _require_episodes_for(
    requirement: Requirement, agent: str, *, clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]
) -> None:
    """Raise `ComparisonError` for episodes of another agent or setting, or that the setting did not touch."""
    setting, baseline = requirement.setting, str(requirement.setting.baseline)
    _require_episodes_of(agent, [str(setting)], perturbed)
    require_touched(setting, perturbed)
    if clean:
        known = [baseline] if requirement.metric.needs_clean else [baseline, str(Setting.CLEAN)]
        _require_episodes_of(agent, known, clean)


def _require_episodes_of(agent: str, settings: Sequence[str], results: Sequence[EpisodeResult]) -> None:
    if not results:
        raise ComparisonError(
            f"no episode of agent {agent!r} was driven under {settings[0]!r}, so there is nothing to judge."
        )
    require_scorable(results)
    for result in results:
        if result.episode.agent != agent or result.episode.setting not in settings:
            raise ComparisonError(
                f"expected episodes of agent {agent!r} under {settings[0]!r}, but got {result.episode}."
            )
