"""A comparison with another run as plain data: changes of the metrics, and the routes that flipped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.regression.comparison_result import CellComparison, Comparison, Flip
from pytest_drive_robust.regression.snapshot import RouteScore
from pytest_drive_robust.report.comparison import conclusion
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.stats.intervals import mean_interval


def comparison_data(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as plain data; for a refused comparison the reasons instead of the settings."""
    refused = bool(comparison.refusals)
    return {
        "before": comparison.before.label,
        "beforeStored": comparison.before.made,
        "after": comparison.after.label,
        "conclusion": conclusion(comparison),
        "regressed": comparison.regressed,
        "refused": refused,
        "notes": [*comparison.unscored, *(item.text for item in comparison.mismatches), *comparison.notes],
        "means": {} if refused else {agent: asdict(rise) for agent, rise in comparison.mean_rises.items()},
        "settings": [] if refused else [_setting(comparison, cell) for cell in comparison.cells],
    }


def flipped(comparison: Comparison, before: RunRecords) -> Iterator[Episode]:
    """Yield the episodes of the run `before` on routes that flipped, if that run holds the episode."""
    if comparison.refusals:
        return
    for cell in comparison.cells:
        for flip in cell.flips:
            episodes = (
                Episode(cell.agent_before, flip.before.route_id, cell.setting, seed) for seed in flip.before.seeds
            )
            yield from (episode for episode in episodes if episode in before.results)


def _setting(comparison: Comparison, cell: CellComparison) -> dict[str, Any]:
    return {
        "agent": cell.agent,
        "agentBefore": cell.agent_before,
        "setting": cell.setting,
        "verdict": cell.verdict,
        "routes": cell.routes,
        "missing": cell.missing,
        "changed": cell.changed,
        "before": asdict(cell.before),
        "after": asdict(cell.after),
        "dsChange": _ds_change(comparison, cell),
        "rise": None if cell.rise is None else asdict(cell.rise),
        "findings": [[item.verdict, item.allowance.sentence, item.problem] for item in cell.findings],
        "flips": [_flip(flip) for flip in cell.flips],
    }


def _ds_change(comparison: Comparison, cell: CellComparison) -> list[float] | None:
    """Return [mean, low, high] of the change of DS over common routes (95 % interval), or None without any."""
    after = comparison.after.cells.get((cell.agent, cell.setting))
    old = comparison.before.cells.get((cell.agent_before, cell.setting))
    if after is None or old is None:
        return None
    changes = [score.ds - old.routes[name].ds for name, score in after.routes.items() if name in old.routes]
    if not changes:
        return None
    low, high = mean_interval(changes, bounds=(-100.0, 100.0))
    return [round(value, 3) for value in (sum(changes) / len(changes), low, high)]


def _flip(flip: Flip) -> dict[str, Any]:
    return {
        "fails": flip.fails,
        "route": flip.after.route_id,
        "scenario": flip.after.scenario,
        "before": _score(flip.before),
        "after": _score(flip.after),
    }


def _score(score: RouteScore) -> dict[str, Any]:
    return {"ds": round(score.ds, 1), "story": score.outcome, "seed": score.worst_seed}
