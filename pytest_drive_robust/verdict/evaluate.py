"""From episodes to a verdict on one requirement."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.averages import values_by_route
from pytest_drive_robust.metrics.degradation import paired_driving_scores
from pytest_drive_robust.metrics.guards import require_scorable
from pytest_drive_robust.metrics.summary import Summary, summarize
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.stats.intervals import jackknife_interval, mean_interval, ratio_interval, share_interval
from pytest_drive_robust.verdict.divergence import first_divergence_s
from pytest_drive_robust.verdict.forms import margin_of, rule_of
from pytest_drive_robust.verdict.known import known_metric
from pytest_drive_robust.verdict.model import Requirement
from pytest_drive_robust.verdict.touched import require_touched
from pytest_drive_robust.verdict.worst import WorstRoute, worst_routes

__all__ = ["Verdict", "WorstRoute", "first_divergence_s", "judge", "measure"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether `agent` meets `requirement`, and why.

    `decision` is `"pass"`, `"fail"` or `"inconclusive"` by `verdict_rule`; `margin` is its margin in the unit of
    the metric (0 for rules without one) and `reason` says what is not in the numbers. `value` is that of the
    `routes` of `planned` that were driven; `low..high` is its interval over routes like these (95 %, or alpha a side
    of the verdict_rule where evidence was read and may have stopped early), infinite where one route or an unsure clean
    score says nothing. `p_value` is that against "it holds", where evidence was read. `clean` is None when no clean
    episode was given. `worst` are at most three routes, for people.
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

    @property
    def passed(self) -> bool:
        """True for `"pass"` only."""
        return self.decision == "pass"


def judge(
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
    """The verdict on `requirement`. `perturbed` are the episodes under its setting (clean ones for `clean`).

    `decision` is what `verdict_rule` decided while it read the routes (`runner.reading`); without one the value is
    compared with the limit, as the rule `"point"` does. `planned` is how many routes there were to read.

    `clean` may be empty unless the metric is relative to it; when given, it is shown beside the perturbed ones. For a
    relative metric these are episodes under `requirement.setting.baseline`: `clean`, but for settings with a warm-up.

    Raises `ComparisonError` when there is nothing to judge: no episode or no data for the metric, an `infra_error`,
    episodes of another agent or setting, a setting that changed nothing, sets that do not pair.
    """
    metric = known_metric(requirement.metric)
    baseline = str(requirement.setting.baseline)
    _require_episodes_of(agent, [str(requirement.setting)], perturbed)
    require_touched(requirement.setting, perturbed)
    if clean:
        _require_episodes_of(agent, [baseline] if metric.needs_clean else [baseline, str(Setting.CLEAN)], clean)
    value, (low, high) = measure(metric, clean=clean, perturbed=perturbed, mode=mode)
    routes = len({result.episode.route_id for result in perturbed})
    p_value = None
    if decision is None or verdict_rule is None:
        verdict_rule = replace(
            verdict_rule or VerdictRule(), kind="point"
        )  # nothing was read route by route, so nothing is promised
        decision = "pass" if requirement.is_met_by(value) else "fail"
    elif verdict_rule.kind == "evidence":
        ended = planned is None or routes >= planned
        low, high = _honest(metric, clean, perturbed, mode, verdict_rule, ended=ended)
        p_value = _p_value(requirement, clean, perturbed, mode, verdict_rule, ended=ended)
    reason = _clean_floor(metric, clean, verdict_rule)
    return Verdict(
        requirement=requirement,
        agent=agent,
        decision="inconclusive" if reason and decision == "pass" else decision,
        verdict_rule=verdict_rule,
        margin=margin_of(requirement, verdict_rule) if verdict_rule.kind == "evidence" else 0.0,
        reason=reason,
        planned=routes if planned is None else planned,
        value=value,
        low=low,
        high=high,
        routes=routes,
        seeds=len({result.episode.seed for result in perturbed}),
        clean=summarize(clean, mode=mode) if clean else None,
        perturbed=summarize(perturbed, mode=mode),
        worst=worst_routes(clean, perturbed, relative=metric.needs_clean),
        p_value=p_value,
    )


def _honest(
    metric: Metric,
    clean: Sequence[EpisodeResult],
    perturbed: Sequence[EpisodeResult],
    mode: str,
    verdict_rule: VerdictRule,
    *,
    ended: bool,
) -> tuple[float, float]:
    """The interval that holds although reading may have stopped early."""
    from pytest_drive_robust.stats.sequential_intervals import evidence_interval, mean_evidence_interval

    if metric.needs_clean:
        return evidence_interval(*paired_driving_scores(clean, perturbed), verdict_rule.alpha, ended=ended)
    of_episode = metric.of_episode
    assert of_episode is not None  # a user's function is never read route by route
    values = list(values_by_route(perturbed, lambda result: of_episode(result, mode)).values())
    return mean_evidence_interval(values, verdict_rule.alpha, low=metric.low, high=metric.high, ended=ended)


def _p_value(
    requirement: Requirement,
    clean: Sequence[EpisodeResult],
    perturbed: Sequence[EpisodeResult],
    mode: str,
    verdict_rule: VerdictRule,
    *,
    ended: bool,
) -> float:
    """Of the episodes in the order in which they were read."""
    from pytest_drive_robust.stats.several import fail_p_value

    metric, rule = known_metric(requirement.metric), rule_of(requirement, verdict_rule)
    if metric.needs_clean:
        references, scores = paired_driving_scores(clean, perturbed)
        return fail_p_value(rule, scores, references, ended=ended)
    of_episode = metric.of_episode
    assert of_episode is not None  # a user's function is never read route by route
    values = values_by_route(perturbed, lambda result: of_episode(result, mode))
    return fail_p_value(rule, list(values.values()), ended=ended)


def _clean_floor(metric: Metric, clean: Sequence[EpisodeResult], verdict_rule: VerdictRule) -> str:
    """Why an RD says nothing: an agent that hardly drives has little to lose."""
    if not metric.needs_clean or verdict_rule.kind == "point":
        return ""
    scores, _ = paired_driving_scores(clean, clean)
    mean = math.fsum(scores) / len(scores)
    if mean >= verdict_rule.clean_floor:
        return ""
    return (
        f"the clean driving score is {mean:.1f}, below the floor of {verdict_rule.clean_floor:g}: RD says nothing yet"
    )


def measure(
    metric: Metric,
    *,
    clean: Sequence[EpisodeResult],
    perturbed: Sequence[EpisodeResult],
    mode: str = "bench2drive",
) -> tuple[float, tuple[float, float]]:
    """The value of a metric and its 95 % interval (low, high); the unit of analysis is the route.

    Fieller for RD, Wilson for SR, Student's t for other means over episodes, jackknife for a user's function. Raises
    `ComparisonError` when the episodes hold no data for the metric, and for sets that the metric refuses.
    """
    value = metric.measure(perturbed, clean=clean, mode=mode)
    if value is None:
        raise ComparisonError(
            f"the {len(perturbed)} episodes under {perturbed[0].episode.setting!r} hold no data for {metric.name} "
            f"({metric.meaning}), so there is nothing to judge."
        )
    if not math.isfinite(value):
        raise ComparisonError(
            f"the metric {metric.name} gave {value!r}, expected a finite number, or None for no data."
        )
    return float(value), _interval(metric, float(value), clean, perturbed, mode)


def _interval(
    metric: Metric, value: float, clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult], mode: str
) -> tuple[float, float]:
    bounds = (metric.low, metric.high)
    if metric.needs_clean:
        return ratio_interval(*paired_driving_scores(clean, perturbed))
    of_episode, function = metric.of_episode, metric.function
    if of_episode is not None:
        values = list(values_by_route(perturbed, lambda result: of_episode(result, mode)).values())
        return share_interval(values) if bounds == (0.0, 1.0) else mean_interval(values, bounds=bounds)
    routes = dict.fromkeys(result.episode.route_id for result in perturbed)
    if function is None or len(routes) < 2:
        return bounds
    without = [function([result for result in perturbed if result.episode.route_id != route]) for route in routes]
    known = [other for other in without if other is not None]
    return jackknife_interval(value, known, bounds=bounds) if len(known) == len(without) else bounds


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
