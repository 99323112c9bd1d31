"""Which settings and routes two runs share, and what one of them lacks."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from pytest_drive_robust.errors import first_few
from pytest_drive_robust.regression.fingerprint import Mismatch
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot
from pytest_drive_robust.runner.plan import planned_order

Pair = tuple[RouteScore, RouteScore]
CellPair = tuple[Cell, Cell]
"""The same agent and setting, before and after."""

_MOST_ROUTES = 5
"""So many are named."""
_CUT_OFF = "not all tests of the run came to their verdicts"


@dataclass(frozen=True, slots=True)
class Shared:
    """What two runs share: `compared` are the settings with common routes, `unscored` those of which the new run asked
    for episodes and scored none, or which it lacks because it ended before its tests. `lacking` are sentences about
    settings that cannot be compared, one for each.
    """

    compared: tuple[CellPair, ...]
    unscored: tuple[Cell, ...]
    lacking: tuple[str, ...]
    mismatches: tuple[Mismatch, ...]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, before: Snapshot, after: Snapshot) -> Shared:
        """Match agents as `renamed_agents` says."""
        renamed = renamed_agents(before.agents, after.agents)
        matched = [
            (before.cells.get((renamed.get(agent, agent), setting)), new)
            for (agent, setting), new in after.cells.items()
        ]
        both = [(old, new) for old, new in matched if old is not None]
        unscored = tuple(new for _, new in both if new.broken and not new.routes)
        pairs = [(old, new) for old, new in both if new not in unscored]
        compared = tuple((old, new) for old, new in pairs if pairs_of(old, new))
        known = [old for old, _ in both]
        only_before = [old for old in before.cells.values() if old not in known]
        only_after = [new for old, new in matched if old is None]
        if after.ended_early:
            unscored += tuple(replace(old, routes={}, broken=(_CUT_OFF,)) for old in only_before)
            only_before = []
        lacking = [
            *(f"not in {before.label}: {_named(new)}" for new in only_after),
            *(
                f"not in {before.label} on the same routes: {_named(new)}"
                for old, new in pairs
                if not pairs_of(old, new)
            ),
            *(f"not in {after.label}: {_named(old)}" for old in only_before),
        ]
        notes = [f"{old} is compared with {new}" for new, old in renamed.items()]
        only_new = [told for old, new in compared for told in _only_in(new, old.routes)]
        notes += [f"not in {before.label}: {_first_of(only_new)}"] if only_new else []
        whole = [(old, new.routes) for old, new in pairs if not (new.broken or new.stopped)]  # these tell themselves
        mismatches = (
            *cut_off(before, map(_named, only_after)),
            *incomplete(before.label, [old for old, _ in pairs]),
            *stopped(before.label, [old for old, _ in pairs]),
            *stopped(after.label, [new for _, new in pairs]),
            *not_driven(before.label, after.label, whole),
        )
        return cls(compared, unscored, tuple(lacking), mismatches, tuple(notes))


def pairs_of(old: Cell, new: Cell) -> list[Pair]:
    """Return the routes that both hold, in the planned order of the setting."""
    common = [route for route in new.routes if route in old.routes]
    types = [new.routes[route].scenario for route in common]
    order = planned_order(common, types, f"{new.agent} {new.setting}")
    return [(old.routes[route], new.routes[route]) for route in order]


def renamed_agents(before: Sequence[str], after: Sequence[str]) -> Mapping[str, str]:
    """Return what agents of the new run are called in the old one, where the names differ: each run has one agent."""
    return {after[0]: before[0]} if len(before) == len(after) == 1 and after[0] != before[0] else {}


def cut_off(before: Snapshot, lacking: Iterable[str]) -> Iterable[Mismatch]:
    """Yield a mismatch where the old run lacks what is asked for (`"AGENT under SETTING"`) as it ended before that."""
    told = list(lacking) if before.ended_early else []
    if told:
        text = f"not all tests of {before.label} came to their verdicts, and it lacks {_first_of(told)}"
        yield Mismatch("routes", text, "Run the command of that run again")


def incomplete(label: str, cells: Iterable[Cell]) -> Iterable[Mismatch]:
    """Yield a mismatch where the old run lacks scores of these cells: against few of them nothing gets worse."""
    told = [f"under {cell.setting}: {cell.broken[0]}" for cell in cells if cell.broken]
    if told:
        yield Mismatch("routes", f"{label} is incomplete {_first_of(told)}", "Run the command of that run again")


def stopped(label: str, cells: Iterable[Cell]) -> Iterable[Mismatch]:
    """Yield a mismatch where the verdicts of the run did without some routes of these cells."""
    told = [f"{routes} under {cell.setting}" for cell in cells for routes in cell.stopped]
    if told:
        text = f"{label} was driven until its verdicts were in, which says nothing about two runs"
        yield Mismatch(
            "routes", f"{text}: {_first_of(told)}", "Drive that run with --drive-save or --drive-verdict=point"
        )


def not_driven(before: str, after: str, pairs: Iterable[tuple[Cell, Collection[str]]]) -> Iterable[Mismatch]:
    """Yield a mismatch where the new run, which has these routes for a cell of the old one, lacks some of it."""
    told = [told for old, routes in pairs for told in _only_in(old, routes)]
    if told:
        yield Mismatch("routes", f"{after} lacks routes of {before}: {_first_of(told)}", "Drive these routes, too")


def other_content(old: Cell, digests: Mapping[str, str]) -> Iterable[Mismatch]:
    """Yield a mismatch where routes of the new run, which have these digests, are others by the same id."""
    shared = [(route, old.routes[route].digest, digest) for route, digest in digests.items() if route in old.routes]
    others = [route for route, was, now in shared if was and now and was != now]
    if others:
        shown = first_few(others, _MOST_ROUTES)
        yield Mismatch("routes", f"{len(others)} of {len(shared)} routes are others by the same id: {shown}")


def _only_in(one: Cell, other: Collection[str]) -> Iterable[str]:
    """Yield how many routes of `one` the `other` lacks, and which; nothing where it lacks none."""
    lacking = [route for route in one.routes if route not in other]
    if lacking:
        shown = first_few(lacking, _MOST_ROUTES)
        yield f"{len(lacking)} of {len(one.routes)} under {one.setting} ({shown})"


def _first_of(told: Sequence[str]) -> str:
    others = len(told) - 1
    return told[0] + (f", and so under {others} more setting{'' if others == 1 else 's'}" if others else "")


def _named(cell: Cell) -> str:
    return f"{cell.agent} under {cell.setting}"
