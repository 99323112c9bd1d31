"""Proposes limits that an agent meets, with the distance that a verdict from evidence needs, from a stored run.

Evidence passes an agent that is shown to be better than limit + margin, and the routes of the run can tell apart values
that differ by `told_apart`. So a limit lies `max(told_apart - margin, 0)` beyond the value, and moves farther, step by
step, until the scores of the run pass it: evidence takes into account rare failures that were not seen. A list with too
few routes for evidence is judged by its value; the distance is then one step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import UnknownNameError, UsageError, first_few
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot
from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.stats.judges import judge_by, read_until_decided
from pytest_drive_robust.stats.resolution import told_apart
from pytest_drive_robust.verdict.requirement import Requirement

_STEP = 0.05
"""The step of limits, as a share of the range; limits are rounded leniently. Finer steps would pretend to know more."""
_FEWEST_ROUTES = 2


@dataclass(frozen=True, slots=True)
class ProposedLimit:
    """A requirement that the agent meets, the measured `value`, and its distance `spare` from the limit."""

    requirement: Requirement
    value: float
    spare: float
    routes: int


def propose_limits(
    run: Snapshot, agent: str, *, perturbations: Mapping[str, type[Perturbation]], rule: VerdictRule
) -> tuple[ProposedLimit, ...]:
    """Return a limit for each setting of `agent`: on DS for the clean setting, on RD for the others.

    Leaves out limits that could not be broken (an RD of 1, a DS of 0) and an RD whose clean driving score is below the
    floor. Raises `UsageError` when no limit is left, when `agent` is not in the run, and when the run ended early, has
    a test that a verdict stopped or episodes without a score, or has verdicts that were reached without some of the
    routes.
    """
    driven = run.of_agent(agent)
    if not driven.cells:
        raise UnknownNameError.of("agent", agent, run.agents, hint=f"The run is {run.label!r}.")
    _require_whole(driven)
    cells = {Setting.parse(cell.setting, perturbations): cell for cell in driven.cells.values()}
    proposed = [_proposed(setting, cells, rule) for setting in cells]
    found = sorted(filter(None, proposed), key=lambda item: item.requirement.needs_clean)
    if not found:
        raise UsageError(
            f"the run {run.label!r} shows no limit for {agent!r}: expected {_FEWEST_ROUTES} routes or more, driven "
            f"clean and under failures, and a clean driving score of {rule.clean_floor:g} or more."
        )
    return tuple(found)


def kept_requirements(
    stated: Iterable[Mapping[str, Any]], agent: str, proposed: Sequence[ProposedLimit]
) -> tuple[str, ...]:
    """Return the sentences of a run's requirements on `agent` that no proposal replaces, from the run's document."""
    replaced = {(str(item.requirement.metric), str(item.requirement.setting)) for item in proposed}
    sentences = [
        str(item["requirement"])
        for item in stated
        if item["agent"] == agent
        # a margin requirement also has a metric and a setting, but states no limit on them: keep it
        if (item["metric"], item["setting"]) not in replaced or not item["requirement"].startswith(f"{item['metric']} ")
    ]
    return tuple(dict.fromkeys(sentences))


def _require_whole(run: Snapshot) -> None:
    if run.lacks:
        raise UsageError(
            f"the run {run.label!r} is incomplete: {run.lacks}. Such a run gives no limits: run its command again."
        )
    if run.stopped_tests:
        raise UsageError(
            f"the run {run.label!r} is incomplete: a verdict stopped {first_few(run.stopped_tests, 1)}, so what stands "
            "after that may be missing. Such a run gives no limits: give each requirement a test or a subtest of its "
            "own, and run its command again."
        )
    if run.left_out:
        raise UsageError(
            f"the run {run.label!r} was driven only until its verdicts were clear, on {run.left_out}. Its limits "
            "decided which routes it drove, so it gives no new limits. Drive it with --drive-save or "
            "--drive-verdict=point."
        )


def _proposed(setting: Setting, cells: Mapping[Setting, Cell], rule: VerdictRule) -> ProposedLimit | None:
    """Return the strictest limit that the scores pass, or None when there is no such limit."""
    clean = cells[setting.baseline].routes if setting.baseline in cells else {}
    pairs = _pairs_in_order(cells[setting], clean)
    if len(pairs) < _FEWEST_ROUTES:
        return None
    mean = fmean(before for _, before in pairs)
    if mean < rule.clean_floor or (setting == setting.baseline and not setting.is_clean):
        return None
    if setting.is_clean:
        value = mean
        spare = _spare(len(pairs), stdev(score for score, _ in pairs), 100.0, rule)
        most = math.floor(round((value - spare) / (100.0 * _STEP), 6))
        candidates = (Requirement("DS", setting, ">=", steps * 100.0 * _STEP) for steps in range(most, 0, -1))
    else:
        value = 1.0 - fmean(score for score, _ in pairs) / mean
        spare = _spare(len(pairs), stdev(score - (1.0 - value) * before for score, before in pairs) / mean, 1.0, rule)
        least = max(0, math.ceil(round((value + spare) / _STEP, 6)))
        candidates = (
            Requirement("RD", setting, "<=", round(steps * _STEP, 2)) for steps in range(least, round(1 / _STEP))
        )
    for requirement in candidates:
        if _is_passed(requirement, pairs, rule):
            distance = requirement.limit - value if requirement.needs_clean else value - requirement.limit
            return ProposedLimit(requirement, value, distance, len(pairs))
    return None


def _pairs_in_order(cell: Cell, clean: Mapping[str, RouteScore]) -> list[tuple[float, float]]:
    """Return (score, clean score) of each route with both, in the order in which a run reads the routes.

    A verdict may stop early in one order and not in another.
    """
    routes = [route for route in cell.routes if route in clean]
    order = planned_order(routes, [cell.routes[route].scenario for route in routes], cell.agent)
    return [cell.routes[route].paired_with(clean[route]) for route in order]


def _is_passed(requirement: Requirement, pairs: Sequence[tuple[float, float]], rule: VerdictRule) -> bool:
    """Return whether the (score, clean score) pairs of all routes pass the requirement, read route by route."""
    rule = rule.for_routes(len(pairs))
    floor = rule.clean_floor if requirement.needs_clean else 0.0
    forms = requirement.linear_forms(rule)
    judge = judge_by(rule.kind, forms, planned=len(pairs), alpha=rule.alpha, floor=floor)
    return read_until_decided(judge, pairs)[0] == "pass"


def _spare(count: int, noise: float, scale: float, rule: VerdictRule) -> float:
    """Return the distance between value and limit before rounding, in the unit of the metric."""
    if rule.for_routes(count).kind != "evidence":
        return scale * _STEP
    return max(told_apart(count, noise, alpha=rule.alpha, scale=scale) - scale * rule.margin, 0.0)
