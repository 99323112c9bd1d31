"""Checks before the drive, by the plan of a run, whether the run could be compared with an earlier run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain

from pytest_drive_robust.errors import UsageError, first_few
from pytest_drive_robust.regression.comparison import require_more_than_rd_of_clean
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.fingerprint import Fingerprint, Mismatch, mismatches, stuck_stops
from pytest_drive_robust.regression.shared_routes import (
    cut_off,
    incomplete,
    not_driven,
    other_content,
    renamed_agents,
    stopped,
)
from pytest_drive_robust.regression.snapshot import Cell, Snapshot
from pytest_drive_robust.runner.cache_key.identity import route_digest
from pytest_drive_robust.runner.plan import EpisodeRequest

_LABEL = "this run"
_MOST_CELLS = 3
"""How many cells an error message names."""


def check_planned_run(
    before: Snapshot,
    requests: Iterable[EpisodeRequest],
    *,
    whole: bool,
    driven_with: Callable[[str], Fingerprint],
    terms: Terms,
) -> None:
    """Raise `UsageError` when a comparison with `before` would be refused, however the planned episodes end.

    `whole` says that nothing else will be driven; otherwise tests may need more episodes than are planned.
    `driven_with` returns the fingerprint of an agent as far as it is known; empty versions are unknown versions.
    """
    planned: dict[tuple[str, str], dict[str, str]] = {}
    for request in requests:
        episode = request.episode
        routes = planned.setdefault((episode.agent, episode.setting), {})
        if episode.route_id not in routes:
            routes[episode.route_id] = route_digest(request.route)
    renamed = renamed_agents(before.agents, tuple(dict.fromkeys(agent for agent, _ in planned)))
    common = [
        (agent, old, routes)
        for (agent, setting), routes in planned.items()
        if (old := before.cells.get((renamed.get(agent, agent), setting))) is not None
    ]
    pairs = [(old, routes) for _, old, routes in common]
    lacking = [
        f"{agent} under {setting}"
        for agent, setting in planned
        if (renamed.get(agent, agent), setting) not in before.cells
    ]
    if whole and planned and not any(old.routes.keys() & routes for old, routes in pairs):
        raise UsageError(_nothing_in_common(before, planned))
    if whole and planned:
        require_more_than_rd_of_clean(terms.allowances, [old.setting for old, _ in pairs])
    found = chain(
        cut_off(before, lacking), _driven_otherwise(common, driven_with), _of_routes(before, pairs, whole=whole)
    )
    refused = next((item for item in found if item.refuses(terms.policy)), None)
    if refused is not None:
        raise UsageError(
            f"{_LABEL} could not be compared with {before.label}: {refused.text}. {refused.advice}, or give "
            "--drive-on-mismatch=warn."
        )


def _driven_otherwise(
    common: Iterable[tuple[str, Cell, Mapping[str, str]]], driven_with: Callable[[str], Fingerprint]
) -> Iterator[Mismatch]:
    seen: list[Fingerprint] = []
    for agent, old, _ in common:
        for score in old.routes.values():
            if score.fingerprint not in seen:
                seen.append(score.fingerprint)
                after = driven_with(agent)
                if after.versions:
                    yield from mismatches(score.fingerprint, after, agent=old.agent)
                else:
                    yield from stuck_stops(score.fingerprint.stuck_stop_s, after.stuck_stop_s)


def _of_routes(before: Snapshot, pairs: Sequence[tuple[Cell, Mapping[str, str]]], *, whole: bool) -> Iterator[Mismatch]:
    yield from incomplete(before.label, [cell for cell, _ in pairs])
    yield from stopped(before.label, [cell for cell, _ in pairs])
    for cell, routes in pairs:
        yield from other_content(cell, routes)
    if whole:
        yield from not_driven(before.label, _LABEL, pairs)


def _nothing_in_common(before: Snapshot, planned: Collection[tuple[str, str]]) -> str:
    asked = first_few([f"{agent} under {setting}" for agent, setting in planned], _MOST_CELLS)
    held = first_few([cell.name for cell in before.cells.values()], _MOST_CELLS)
    return (
        f"{_LABEL} could not be compared with {before.label}: they have no agent, setting and route in common. "
        f"{_LABEL.capitalize()} drives {asked}; {before.label} holds {held or 'nothing'}."
    )
