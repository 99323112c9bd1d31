"""Builds snapshots for tests of what compares them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pytest_drive_robust.regression.allowance import parse_allowances
from pytest_drive_robust.regression.baselines import Blessing
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.fingerprint import AgentPrint, Fingerprint
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot, Taken

PRINT = Fingerprint(
    simulator="fake",
    agent=AgentPrint("agents 1", "aaaaaaaaaaaa", ""),
    versions={"fake": "1", "numpy": "2.0", "python": "3.11"},
)
SIGNATURE = Blessing("2026-11-21", "first baseline", by="Kim Doe <kim@example.org>", run="before", commit="abc123")
BUSY = [100.0, 60.0, 100.0, 36.0, 100.0, 100.0, 20.0, 80.0] * 8
"""Driving scores of 64 routes, as a middling agent has them."""


def route_score(
    route_id: str,
    ds: float,
    *,
    success: bool | None = None,
    seed: int = 0,
    digest: str = "d0",
    fingerprint: Fingerprint = PRINT,
) -> RouteScore:
    taken = Taken(seed, ds, ds == 100.0 if success is None else success, "completed" if ds == 100.0 else "stuck")
    scenario = f"Kind{sum(map(ord, route_id)) % 3}"
    return RouteScore.of(route_id, scenario, [taken], digest=digest, fingerprint=fingerprint)


def cell(
    scores: Mapping[str, float] | Sequence[float],
    *,
    agent: str = "driver",
    setting: str = "clean",
    broken: tuple[str, ...] = (),
    **given: object,
) -> Cell:
    """Make a cell of scores by route; a list gives the routes 1, 2, 3, ..."""
    named = scores if isinstance(scores, Mapping) else {str(n): ds for n, ds in enumerate(scores, start=1)}
    routes = {route: route_score(route, ds, **given) for route, ds in named.items()}  # type: ignore[arg-type]
    return Cell(agent, setting, "routes.xml", routes, broken)


def snapshot(*cells: Cell, label: str = "run") -> Snapshot:
    return Snapshot(label, {(item.agent, item.setting): item for item in cells})


def with_versions(**versions: str) -> Fingerprint:
    return replace(PRINT, versions={**PRINT.versions, **versions})


def terms(*texts: str, **given: object) -> Terms:
    return Terms(parse_allowances(texts, source="--fail-on"), **given)  # type: ignore[arg-type]
