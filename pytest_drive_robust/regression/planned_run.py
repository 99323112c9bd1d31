"""Why a run could not be compared with an earlier one, as far as its plan tells before anything is driven."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.fingerprint import Mismatch, MismatchPolicy, stuck_stops
from pytest_drive_robust.regression.shared_routes import not_driven, other_content, renamed_agents, stopped
from pytest_drive_robust.regression.snapshot import Cell, Snapshot
from pytest_drive_robust.runner.cache_key.identity import route_digest
from pytest_drive_robust.runner.plan import EpisodeRequest

_LABEL = "this run"


def check_planned_run(
    before: Snapshot,
    requests: Iterable[EpisodeRequest],
    *,
    whole: bool,
    stuck_stop_s: float | None,
    policy: MismatchPolicy,
) -> None:
    """Raise `UsageError` where comparing with `before` would be refused, however the planned episodes end.

    `whole` says that nothing else will be driven; tests may ask for more than is planned.
    """
    planned: dict[tuple[str, str], dict[str, str]] = {}
    for request in requests:
        episode = request.episode
        routes = planned.setdefault((episode.agent, episode.setting), {})
        if episode.route_id not in routes:
            routes[episode.route_id] = route_digest(request.route)
    renamed = renamed_agents(before.agents, tuple(dict.fromkeys(agent for agent, _ in planned)))
    pairs = [
        (old, routes)
        for (agent, setting), routes in planned.items()
        if (old := before.cells.get((renamed.get(agent, agent), setting))) is not None
    ]
    found = _mismatches(before, pairs, whole=whole, stuck_stop_s=stuck_stop_s)
    refused = next((item for item in found if item.refuses(policy)), None)
    if refused is not None:
        raise UsageError(
            f"{_LABEL} could not be compared with {before.label}: {refused.text}. {refused.advice}, or give "
            "--drive-on-mismatch=warn."
        )


def _mismatches(
    before: Snapshot, pairs: Sequence[tuple[Cell, Mapping[str, str]]], *, whole: bool, stuck_stop_s: float | None
) -> Iterable[Mismatch]:
    scores = chain.from_iterable(cell.routes.values() for cell, _ in pairs)
    stops = dict.fromkeys(score.fingerprint.stuck_stop_s for score in scores)
    for stop_s in stops:
        yield from stuck_stops(stop_s, stuck_stop_s)
    yield from stopped(before.label, [cell for cell, _ in pairs])
    for cell, routes in pairs:
        yield from other_content(cell, routes)
    if whole:
        yield from not_driven(before.label, _LABEL, pairs)
