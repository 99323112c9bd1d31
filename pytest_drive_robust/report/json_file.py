"""The run as JSON, `schema` 1: numbers are not rounded, and a missing number is null."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.metrics.score import driving_score, is_success
from pytest_drive_robust.regression.comparison_result import CellComparison, Comparison
from pytest_drive_robust.regression.document import SCHEMA, json_text
from pytest_drive_robust.report.cautions import cautions
from pytest_drive_robust.report.comparison import conclusion
from pytest_drive_robust.report.run_result import RunResult, SettingRow
from pytest_drive_robust.store.episode_fields import fields_of
from pytest_drive_robust.store.whole_file import write_whole

_SUMMARY = ("ds", "sr", "efficiency", "comfort", "abilities", "signs_between", "episodes", "agent_errors")


def write_json(path: Path, document: Mapping[str, object], comparison: Comparison | None) -> None:
    """Write the document of a run and its comparison to `path`, which is either untouched or whole."""
    compared = {} if comparison is None else {"comparison": comparison_as_json(comparison)}
    write_whole(path, json_text({**document, **compared}))


def run_as_json(run: RunResult) -> dict[str, object]:
    """Return the run as plain JSON types; NaN and infinity become None."""
    document = {
        "schema": SCHEMA,
        "settings": run.options.to_json(),
        "versions": dict(run.versions),
        "fingerprint": _fingerprint(run),
        "requirements": [asdict(judged) for judged in run.judged],
        "searches": [asdict(searched) for searched in run.searched],
        "summaries": [_row(row) for row in run.rows],
        "episodes": [episode_as_json(key, result) for key, result in run.episodes.items()],
        "notes": [*cautions(run), *run.notes],
        "ended_early": run.ended_early,
        "stopped_tests": run.stopped_tests,
        "own_verdicts": run.own_verdicts,
    }
    return {key: _finite(value) for key, value in document.items()}


def comparison_as_json(comparison: Comparison) -> dict[str, object]:
    """Return a comparison as plain JSON types; for a refused comparison the reasons instead of the verdicts."""
    terms, refused = comparison.terms, [item.text for item in comparison.refusals]
    document = {
        "label": comparison.before.label,
        "terms": {
            "fail_on": list(map(str, terms.allowances)),
            "verdict": terms.rule,
            "on_mismatch": terms.policy,
            "inconclusive": "fail" if terms.open_fails else "warn",
        },
        "conclusion": conclusion(comparison),
        "refused": refused,
        "regressed": None if refused else comparison.regressed,
        "cells": [] if refused else [_compared(cell) for cell in comparison.cells],
        "unscored": comparison.unscored,
    }
    return {key: _finite(value) for key, value in document.items()}


def _compared(cell: CellComparison) -> dict[str, object]:
    return {
        "agent": cell.agent,
        "setting": cell.setting,
        "verdict": cell.verdict,
        "routes": cell.routes,
        "changed": cell.changed,
        "before": asdict(cell.before),
        "after": asdict(cell.after),
    }


def _fingerprint(run: RunResult) -> dict[str, object]:
    """Return the digests of agents and routes; two runs with equal digests drove equal agents on equal routes."""
    return {
        "agents": {
            item.agent: {"distribution": item.distribution, "source": item.source, "weights": item.weights}
            for item in run.identified
        },
        "routes": {
            route_id: digest
            for item in run.identified
            for route_id, _, digest in (route.rpartition("=") for route in item.routes)
        },
    }


def _row(row: SettingRow) -> dict[str, object]:
    return {
        "agent": row.agent,
        "privileged": row.privileged,
        "routes_spec": row.routes_spec,
        "routes": row.routes,
        "seeds": row.seeds,
        "setting": row.setting,
        "episodes_needed": row.needed,
        "episodes_finished": len(row.results),
        "summary": None if row.summary is None else {name: getattr(row.summary, name) for name in _SUMMARY},
        "routes_planned": row.planned,
        "ds_interval": row.ds_interval,
        "rd": row.rd,
        "rd_interval": row.rd_interval,
        "verdict": row.verdict,
        "problem": row.problem or None,
    }


def episode_as_json(key: str, result: EpisodeResult) -> dict[str, object]:
    """Return the fields and scores of an episode, with the digest in place of the trace; None for a missing number."""
    score, success = _score(result)
    told = fields_of(result)
    if score is None:
        told["route_completion_pct"] = None  # unknown, because the simulation broke
    del told["inference_s"]  # long; the record in the store holds the time of every call
    return {"key": key, **told, "driving_score": score, "success": success, "game_s": result.game_s}


def _score(result: EpisodeResult) -> tuple[float | None, bool | None]:
    try:
        return driving_score(result), is_success(result)
    except ComparisonError:
        return None, None


def _finite(value: object) -> object:
    """Return plain types: None for NaN and infinity, which JSON cannot hold, Python numbers for numpy scalars."""
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, (str, bool)) or value is None:
        return value
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
