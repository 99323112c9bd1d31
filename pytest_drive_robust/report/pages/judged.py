"""A requirement as plain data: value and limit, the promise of the verdict, the routes that explain the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.metrics.episodes import route_and_seed
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.report.numbers import in_percent
from pytest_drive_robust.report.pages.episodes import EpisodeTable
from pytest_drive_robust.report.pages.evidence import bound, growth, reading_order
from pytest_drive_robust.report.promise import OPEN, claims, confidence, of_these_routes, shown_by_evidence
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.verdict.evaluate import yardstick_of
from pytest_drive_robust.verdict.explain import worst_routes
from pytest_drive_robust.verdict.known_metrics import known_metric
from pytest_drive_robust.verdict.limits import lenient_limit

_BROKEN = (Outcome.INFRA_ERROR, Outcome.AGENT_ERROR)
_NAMES = ("nodeid", "requirement", "agent", "setting", "metric", "comparison", "limit", "verdict", "value")


def requirement_data(records: RunRecords, table: EpisodeTable, judged: Mapping[str, Any]) -> dict[str, Any]:
    """Return the data of a requirement's page; episodes are given by their numbers in `table`."""
    is_error = judged["verdict"] == "error"
    order = [] if is_error else reading_order(records, judged)
    metric = _metric(judged["metric"])
    rule, alpha = judged.get("rule", ""), records.alpha
    lenient = None if metric is None else _lenient(records, judged, metric)
    return {
        **{name: judged[name] for name in _NAMES},
        "routesSpec": judged["routes_spec"],
        "low": bound(judged.get("low")),
        "high": bound(judged.get("high")),
        "level": level_text(rule, alpha),
        "routes": judged["routes"],
        "planned": judged.get("planned", judged["routes"]),
        "rule": rule,
        "reason": judged.get("message", "") or (OPEN if judged["verdict"] == "inconclusive" else ""),
        "lenient": lenient,
        "promise": _promise(judged, metric, lenient, alpha),
        "seeds": judged["seeds"],
        "order": order,
        "growth": growth(records, judged, order),
        "worst": [] if metric is None or is_error else _worst(records, table, judged, metric, order),
        "broken": _broken(records, table, judged, metric) if is_error else [],
    }


def level_text(rule: str, alpha: float) -> str:
    """Return the confidence of an interval as text, such as `"90 %"`."""
    return f"{in_percent(confidence(rule, alpha))} %"


def _metric(name: str) -> Metric | None:
    try:
        return known_metric(name)
    except (DriveRobustError, ImportError):  # the plugin with the metric is not installed here
        return None


def _lenient(records: RunRecords, judged: Mapping[str, Any], metric: Metric) -> float | None:
    """Return the limit with the margin added, which a pass from evidence is better than; None by other rules."""
    if judged.get("rule") != "evidence":
        return None
    limit, margin = float(judged["limit"]), judged.get("margin")
    if margin is not None:
        return round(limit + float(margin) if judged["comparison"] == "<=" else limit - float(margin), 12)
    usual = records.document["settings"].get("margin")  # older runs have no margin in their verdicts
    return lenient_limit(metric, judged["comparison"], limit, VerdictRule("evidence", margin=usual)) if usual else None


def _promise(judged: Mapping[str, Any], metric: Metric | None, lenient: float | None, alpha: float) -> str:
    """Return the promise of a pass or a fail as a sentence; empty for other verdicts."""
    verdict, rule = judged["verdict"], judged.get("rule", "")
    if verdict not in ("pass", "fail"):
        return ""
    if rule in ("list", "point"):
        routes, planned = judged["routes"], judged.get("planned", judged["routes"])
        said = of_these_routes(rule, routes=routes, planned=planned, alpha=alpha)
        return f"{said[0].upper()}{said[1:]}."
    if metric is None or lenient is None:
        return ""
    broken, held = claims(metric, judged["comparison"], limit=float(judged["limit"]), lenient=lenient)
    claim = broken if verdict == "fail" else held
    return f"Shown: {shown_by_evidence(claim, verdict, alpha=alpha, family=judged.get('family', 1))}."


def _worst(
    records: RunRecords, table: EpisodeTable, judged: Mapping[str, Any], metric: Metric, order: Sequence[str]
) -> list[list[Any]]:
    """Return [episode number, clean value, value] of the worst routes, as the terminal's message names them.

    The values are of the metric that ranked the route, None when the driving score ranked it.
    """
    agent, setting, seeds = judged["agent"], judged["setting"], judged["seeds"]
    perturbed = _scored(records.of_setting(agent, setting, order, seeds))
    twins = [twin for result in perturbed if (twin := records.twin(result.episode)) is not None]
    clean = _scored(twins)
    if metric.needs_clean:
        places = set(map(route_and_seed, clean))
        perturbed = [item for item in perturbed if route_and_seed(item) in places]
    passed = judged["verdict"] == "pass"
    limit, mode = float(judged["limit"]), records.mode
    yardstick = None if passed else yardstick_of(metric, judged["comparison"], limit, mode=mode)
    numbers = {route_and_seed(item): table.numbers[0, item.episode] for item in perturbed}
    return [
        [numbers[item.route_id, item.seed], bound(item.clean_value), bound(item.perturbed_value)]
        for item in worst_routes(clean, perturbed, relative=metric.needs_clean, yardstick=yardstick)
    ]


def _scored(results: Sequence[EpisodeResult]) -> list[EpisodeResult]:
    return [result for result in results if result.outcome is not Outcome.INFRA_ERROR]


def _broken(records: RunRecords, table: EpisodeTable, judged: Mapping[str, Any], metric: Metric | None) -> list[int]:
    """Return the numbers of the episodes that ended in an error, as an explanation of an error verdict."""
    routes = {route.id for route in records.routes.get(judged["routes_spec"], ())}
    settings = {judged["setting"]}
    if metric is not None and metric.needs_clean:
        settings.add(records.baseline(judged["setting"]))
    return [
        table.numbers[0, episode]
        for episode, result in records.results.items()
        if result.outcome in _BROKEN
        and (episode.agent, episode.setting in settings) == (judged["agent"], True)
        and episode.seed in judged["seeds"]
        and (not routes or episode.route_id in routes)
    ]
