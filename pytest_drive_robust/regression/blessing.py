"""Accepting a run: its scores become the baseline that later runs are compared with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.baselines import (
    Baseline,
    BlessedRoute,
    Blessing,
    baseline_file,
    merge,
    read_baseline,
)
from pytest_drive_robust.regression.snapshot import Cell, CellKey, RouteScore, Snapshot
from pytest_drive_robust.store.whole_file import write_whole


@dataclass(frozen=True, slots=True)
class Blessed:
    """What happened to one file: how many scores are new, how many were replaced, how many of others were kept."""

    path: Path
    agent: str
    added: int
    replaced: int
    kept: int


def bless(
    run: Snapshot, folder: Path, signature: Blessing, *, environ: Mapping[str, str], replace_routes: bool = False
) -> tuple[Blessed, ...]:
    """Write the scores of `run` into one file per agent in `folder`; what it did not drive stays as it was.

    `signature` says who accepts it, when and why; its fingerprint is that of each agent's scores.
    Raises `UsageError` where `CI` is set in `environ`, without a reason, for a run that the simulator broke an episode
    of or that holds no score, and, unless `replace_routes`, for routes that are others than the blessed ones of the
    same id. Nothing is written then.
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
        merged = merge(old, new)
        replaced = len(old.routes.keys() & new.routes.keys())
        kept = len(old.routes) - replaced
        prepared.append((Blessed(path, agent, len(new.routes) - replaced, replaced, kept), merged.to_text()))
    folder.mkdir(parents=True, exist_ok=True)
    for blessed, text in prepared:
        write_whole(blessed.path, text)
    return tuple(blessed for blessed, _ in prepared)


def blessed_snapshot(baselines: Iterable[Baseline], *, simulator: str | None, label: str) -> Snapshot:
    """Return what was blessed for one simulator, as a run; for the only one there is when `simulator` is None.

    Raises `UsageError` when nothing was blessed for it, or when it is not clear which one is meant.
    """
    baselines = list(baselines)
    known = sorted({place[0] for baseline in baselines for place in baseline.routes})
    if simulator is None and len(known) == 1:
        simulator = known[0]
    if simulator is None or simulator not in known:
        asked = f"for the simulator {simulator!r}" if simulator else "for one simulator"
        raise UsageError(f"{label} holds nothing {asked}, only for: {', '.join(known) or 'none'}.")
    cells: dict[CellKey, dict[str, RouteScore]] = {}
    for baseline in baselines:
        for (world, setting, route_id), route in baseline.routes.items():
            if world == simulator:
                routes = cells.setdefault((baseline.agent, setting), {})
                routes[route_id] = route.score
    return Snapshot(label, {key: Cell(*key, "", routes) for key, routes in cells.items()})


def _require_acceptable(run: Snapshot, signature: Blessing, environ: Mapping[str, str]) -> None:
    if environ.get("CI"):
        raise UsageError(
            "CI is set in the environment, and CI never blesses: a baseline is accepted by a person. Fetch the run, "
            "bless it at your desk and commit the file."
        )
    if not signature.reason.strip():
        raise UsageError('a baseline needs a reason, as in --reason "new planner, see #12".')
    broken = [f"{cell.agent} under {cell.setting} on {told}" for cell in run.cells.values() for told in cell.broken]
    if broken:
        raise UsageError(
            f"{len(broken)} episodes of {run.label} broke in the simulator, first {broken[0]}. Such a run is no "
            "baseline: drive it again."
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
            f"{len(others)} routes are others than the blessed ones of the same id, first {route_id!r} under "
            f"{setting}. Give --replace-routes when the routes were changed on purpose."
        )


def _baseline(run: Snapshot, agent: str, signature: Blessing) -> Baseline:
    routes = {
        (score.fingerprint.simulator, setting, route_id): BlessedRoute(
            signature.date, replace(score, ds=round(score.ds, 3), sr=round(score.sr, 3))
        )
        for (name, setting), cell in run.cells.items()
        if name == agent
        for route_id, score in cell.routes.items()
    }
    prints = [route.score.fingerprint for route in routes.values()]  # a run has one for each agent
    return Baseline(agent, {signature.date: replace(signature, fingerprint=prints[0])} if prints else {}, routes)
