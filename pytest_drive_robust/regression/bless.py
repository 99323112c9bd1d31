"""Accepts a run: its scores become the baselines of its agents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.baselines import (
    Baseline,
    BlessedRoute,
    Blessing,
    Place,
    baseline_file,
    merge,
    read_baseline,
)
from pytest_drive_robust.regression.snapshot import Snapshot
from pytest_drive_robust.store.whole_file import write_whole


@dataclass(frozen=True, slots=True)
class Blessed:
    """The changes to one baseline file: how many scores were added, replaced, kept and dropped.

    `beside` counts the kept scores that lie on other routes under settings of the run. Later runs without these routes
    are refused.
    """

    path: Path
    agent: str
    added: int
    replaced: int
    kept: int
    beside: int = 0
    dropped: int = 0


def bless(
    run: Snapshot,
    folder: Path,
    signature: Blessing,
    *,
    environ: Mapping[str, str],
    replace_routes: bool = False,
    only: bool = False,
) -> tuple[Blessed, ...]:
    """Write the scores of `run` into one file per agent in `folder`; scores of routes that `run` did not drive stay.

    With `only`, the undriven routes under the driven settings are dropped.

    `signature` says who accepts the run, when and why; its fingerprint is replaced by that of each agent's scores.
    Raises `UsageError`, and writes nothing, if `CI` is set in `environ`, if the reason is empty, or if the run has an
    episode that the simulator broke, a test without a verdict, routes left out because a verdict was reached early, or
    no score. Unless `replace_routes` is set, also raises `UsageError` for a route whose content differs from the
    blessed route with the same id.
    """
    _require_acceptable(run, signature, environ)
    prepared = []
    for agent in run.agents:
        path = baseline_file(folder, agent)
        old = read_baseline(path) if path.exists() else Baseline(agent)
        new = _baseline(run, agent, signature)
        if not new.routes:
            continue
        if not replace_routes:
            _require_same_routes(old, new)
        replaced = len(old.routes.keys() & new.routes.keys())
        beside = _beside(old, new)
        dropped = len(beside) if only else 0
        kept = replace(old, routes={place: old.routes[place] for place in old.routes if place not in beside})
        merged = merge(kept if only else old, new)
        others = len(old.routes) - replaced - dropped
        told = Blessed(path, agent, len(new.routes) - replaced, replaced, others, len(beside) - dropped, dropped)
        prepared.append((told, merged.to_text()))
    folder.mkdir(parents=True, exist_ok=True)
    for blessed, text in prepared:
        write_whole(blessed.path, text.encode("utf-8", "backslashreplace"))  # lone surrogates become JSON escapes
    return tuple(blessed for blessed, _ in prepared)


def _require_acceptable(run: Snapshot, signature: Blessing, environ: Mapping[str, str]) -> None:
    if environ.get("CI"):
        raise UsageError(
            "the environment variable CI is set, and CI never blesses: a person accepts a baseline. Fetch the run, "
            "bless it on your own machine and commit the file."
        )
    if not signature.reason.strip():
        raise UsageError('a baseline needs a reason, as in --reason "new planner, see #12".')
    if run.lacks:
        raise UsageError(f"{run.label} is incomplete: {run.lacks}. It cannot become a baseline: run its command again.")
    if run.left_out:
        raise UsageError(
            f"{run.label} was driven only until its verdicts were clear, on {run.left_out}: later runs cannot be "
            "judged against that. Drive it with --drive-save, or with --drive-verdict=point."
        )
    if not any(cell.routes for cell in run.cells.values()):
        raise UsageError(f"{run.label} holds no score to bless.")


def _require_same_routes(old: Baseline, new: Baseline) -> None:
    others = [
        place
        for place, route in new.routes.items()
        if place in old.routes and old.routes[place].score.digest not in ("", route.score.digest)
    ]
    if others:
        _, setting, route_id = others[0]
        raise UsageError(
            f"{len(others)} routes differ from the blessed routes of the same id, first {route_id!r} under "
            f"{setting}. Give --replace-routes if you changed the routes on purpose."
        )


def _beside(old: Baseline, new: Baseline) -> set[Place]:
    """Return the routes of `old` that `new` lacks under its simulator and settings."""
    driven = {place[:2] for place in new.routes}
    return {place for place in old.routes if place[:2] in driven and place not in new.routes}


def _baseline(run: Snapshot, agent: str, signature: Blessing) -> Baseline:
    routes = {
        (score.fingerprint.simulator, setting, route_id): BlessedRoute(signature.date, score)
        for (name, setting), cell in run.cells.items()
        if name == agent
        for route_id, score in cell.routes.items()
    }
    prints = [route.score.fingerprint for route in routes.values()]  # all equal: a run has one fingerprint per agent
    return Baseline(agent, {signature.date: replace(signature, fingerprint=prints[0])} if prints else {}, routes)
