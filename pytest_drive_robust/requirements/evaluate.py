"""From episodes to a verdict on one requirement."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.averages import values_by_route
from pytest_drive_robust.metrics.degradation import paired_driving_scores
from pytest_drive_robust.metrics.guards import require_scorable
from pytest_drive_robust.metrics.summary import Summary, summarize
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations.setting import Setting
from pytest_drive_robust.requirements.divergence import first_divergence_s
from pytest_drive_robust.requirements.known import known_metric
from pytest_drive_robust.requirements.model import Requirement
from pytest_drive_robust.requirements.touched import require_touched
from pytest_drive_robust.requirements.worst import WorstRoute, worst_routes
from pytest_drive_robust.stats.intervals import jackknife_interval, mean_interval, ratio_interval, share_interval

__all__ = ["Verdict", "WorstRoute", "first_divergence_s", "judge", "measure"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether `agent` meets `requirement`, and why.

    `passed` compares `value` with the limit (equal passes); `low..high` is the 95 % interval of the value over routes
    like these, infinite where one route or an unsure clean score says nothing. `clean` is None when no clean episode
    was given. `worst` are at most three routes, for people.
    """

    requirement: Requirement
    agent: str
    passed: bool
    value: float
    low: float
    high: float
    routes: int
    seeds: int
    clean: Summary | None
    perturbed: Summary
    worst: tuple[WorstRoute, ...]


def judge(
    requirement: Requirement,
    *,
    agent: str,
    clean: Sequence[EpisodeResult],
    perturbed: Sequence[EpisodeResult],
    mode: str = "bench2drive",
) -> Verdict:
    """The verdict on `requirement`. `perturbed` are the episodes under its setting (clean ones for `clean`).

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
    return Verdict(
        requirement=requirement,
        agent=agent,
        passed=requirement.is_met_by(value),
        value=value,
        low=low,
        high=high,
        routes=len({result.episode.route_id for result in perturbed}),
        seeds=len({result.episode.seed for result in perturbed}),
        clean=summarize(clean, mode=mode) if clean else None,
        perturbed=summarize(perturbed, mode=mode),
        worst=worst_routes(clean, perturbed, relative=metric.needs_clean),
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
