"""Which settings and routes two runs share, and what one of them lacks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pytest_drive_robust.regression.fingerprint import Mismatch
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot
from pytest_drive_robust.runner.plan import planned_order

Pair = tuple[RouteScore, RouteScore]
CellPair = tuple[Cell, Cell]
"""The same agent and setting, before and after."""

_MOST_ROUTES = 5
"""So many are named."""


@dataclass(frozen=True, slots=True)
class Shared:
    """What two runs share: `compared` are the settings with common routes, `unscored` those of which the new run asked
    for episodes and scored none. `lacking` are sentences about settings that cannot be compared, one for each.
    """

    compared: tuple[CellPair, ...]
    unscored: tuple[Cell, ...]
    lacking: tuple[str, ...]
    mismatches: tuple[Mismatch, ...]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, before: Snapshot, after: Snapshot) -> Shared:
        """Match agents by name; where each run has one agent and the names differ, these two."""
        renamed = {}
        if len(before.agents) == len(after.agents) == 1 and before.agents != after.agents:
            renamed = {after.agents[0]: before.agents[0]}
        matched = [
            (before.cells.get((renamed.get(agent, agent), setting)), new)
            for (agent, setting), new in after.cells.items()
        ]
        both = [(old, new) for old, new in matched if old is not None]
        unscored = tuple(new for _, new in both if new.broken and not new.routes)
        pairs = [(old, new) for old, new in both if new not in unscored]
        compared = tuple((old, new) for old, new in pairs if pairs_of(old, new))
        known = [old for old, _ in both]
        lacking = [
            *(f"not in {before.label}: {_named(new)}" for old, new in matched if old is None),
            *(
                f"not in {before.label} on the same routes: {_named(new)}"
                for old, new in pairs
                if not pairs_of(old, new)
            ),
            *(f"not in {after.label}: {_named(old)}" for old in before.cells.values() if old not in known),
        ]
        notes = [f"{old} is compared with {new}" for new, old in renamed.items()]
        only_new = [told for old, new in compared for told in _only_in(new, old)]
        notes += [f"not in {before.label}: {_first_of(only_new)}"] if only_new else []
        mismatches = (*_stopped(before, after, pairs), *_not_driven(before, after, pairs))
        return cls(compared, unscored, tuple(lacking), mismatches, tuple(notes))


def pairs_of(old: Cell, new: Cell) -> list[Pair]:
    """Return the routes that both hold, in the planned order of the setting."""
    common = [route for route in new.routes if route in old.routes]
    types = [new.routes[route].scenario for route in common]
    order = planned_order(common, types, f"{new.agent} {new.setting}")
    return [(old.routes[route], new.routes[route]) for route in order]


def _stopped(before: Snapshot, after: Snapshot, pairs: Sequence[CellPair]) -> Iterable[Mismatch]:
    """Yield a mismatch for each run whose verdicts did without some routes of what is compared."""
    for run, cells in ((before, [old for old, _ in pairs]), (after, [new for _, new in pairs])):
        told = [f"{routes} under {cell.setting}" for cell in cells for routes in cell.stopped]
        if told:
            text = f"{run.label} was driven until its verdicts were in, which says nothing about two runs"
            yield Mismatch(
                "routes", f"{text}: {_first_of(told)}", "Drive that run with --drive-save or --drive-verdict=point"
            )


def _not_driven(before: Snapshot, after: Snapshot, pairs: Sequence[CellPair]) -> Iterable[Mismatch]:
    """Yield a mismatch where the new run lacks routes of the old one; what ended early is told of by itself."""
    told = [told for old, new in pairs if not (new.broken or new.stopped) for told in _only_in(old, new)]
    if told:
        text = f"{after.label} lacks routes of {before.label}: {_first_of(told)}"
        yield Mismatch("routes", text, "Drive these routes, too")


def _only_in(one: Cell, other: Cell) -> Iterable[str]:
    """Yield how many routes of `one` the `other` lacks, and which; nothing where it lacks none."""
    lacking = [route for route in one.routes if route not in other.routes]
    if lacking:
        more = f" and {len(lacking) - _MOST_ROUTES} more" if len(lacking) > _MOST_ROUTES else ""
        yield f"{len(lacking)} of {len(one.routes)} under {one.setting} ({', '.join(lacking[:_MOST_ROUTES])}{more})"


def _first_of(told: Sequence[str]) -> str:
    others = len(told) - 1
    return told[0] + (f", and so under {others} more setting{'' if others == 1 else 's'}" if others else "")


def _named(cell: Cell) -> str:
    return f"{cell.agent} under {cell.setting}"
