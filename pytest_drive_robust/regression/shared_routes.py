"""Finds the settings and routes that two runs share, and the parts that one of the runs lacks."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from pytest_drive_robust.errors import first_few
from pytest_drive_robust.regression.fingerprint import Mismatch
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot, first_of
from pytest_drive_robust.runner.planned_order import planned_order

Pair = tuple[RouteScore, RouteScore]
CellPair = tuple[Cell, Cell]
"""The cell of one agent and setting in the old and the new run."""

_MOST_ROUTES = 5
"""How many routes a sentence names."""
_CUT_OFF = "not all tests of the run came to their verdicts"
_STOPPED = "a verdict stopped {}, which may have asked for it after that"


@dataclass(frozen=True, slots=True)
class Shared:
    """The settings that two runs share; `compared` are the settings with common routes.

    `unscored` are the settings of which the new run needed episodes and scored none, or which the new run lacks and may
    have driven if it had not ended early, or if its own verdict had not stopped a test. `lacking` has one sentence for
    each setting that cannot be compared.
    """

    compared: tuple[CellPair, ...]
    unscored: tuple[Cell, ...]
    lacking: tuple[str, ...]
    mismatches: tuple[Mismatch, ...]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, before: Snapshot, after: Snapshot) -> Shared:
        """Return the shared settings of two runs; agents are matched by name or by `renamed_agents`."""
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
        left_out, why = _left_out(only_before, after, {renamed.get(agent, agent) for agent in after.agents})
        unscored += tuple(replace(old, routes={}, broken=(why,)) for old in left_out)
        only_before = [old for old in only_before if old not in left_out]
        lacking = [
            *(f"not in {before.label}: {new.name}" for new in only_after),
            *(f"not in {before.label} on the same routes: {new.name}" for old, new in pairs if not pairs_of(old, new)),
            *(f"not in {after.label}: {old.name}" for old in only_before),
        ]
        notes = [f"{old} is compared with {new}" for new, old in renamed.items()]
        only_new = [told for old, new in compared for told in _only_in(new, old.routes)]
        notes += [f"not in {before.label}: {first_of(only_new)}"] if only_new else []
        # Broken and stopped cells of the new run are reported on their own.
        whole = [(old, new.routes) for old, new in pairs if not (new.broken or new.stopped)]
        mismatches = (
            *cut_off(before, [new.name for new in only_after]),
            *incomplete(before.label, [old for old, _ in pairs]),
            *stopped(before.label, [old for old, _ in pairs]),
            *stopped(after.label, [new for _, new in pairs]),
            *not_driven(before.label, after.label, whole),
        )
        return cls(compared, unscored, tuple(lacking), mismatches, tuple(notes))


def pairs_of(old: Cell, new: Cell) -> list[Pair]:
    """Return the pairs of the routes that both cells hold, in the planned order of the setting."""
    common = [route for route in new.routes if route in old.routes]
    types = [new.routes[route].scenario for route in common]
    order = planned_order(common, types, f"{new.agent} {new.setting}")
    return [(old.routes[route], new.routes[route]) for route in order]


def _left_out(lacking: Sequence[Cell], after: Snapshot, driven: Collection[str]) -> tuple[Sequence[Cell], str]:
    """Return those of the `lacking` cells that the new run may have left out, and why; `driven` are its agents.

    A stopped test has driven its agent before it stopped, so it would not have gone on with another one.
    """
    if after.ended_early:
        return lacking, _CUT_OFF
    if not after.stopped_tests:
        return (), ""
    return [old for old in lacking if old.agent in driven], _STOPPED.format(first_few(after.stopped_tests, 1))


def renamed_agents(before: Sequence[str], after: Sequence[str]) -> Mapping[str, str]:
    """Return {new name: old name} when each run has exactly one agent and the names differ, else an empty mapping."""
    return {after[0]: before[0]} if len(before) == len(after) == 1 and after[0] != before[0] else {}


def cut_off(before: Snapshot, lacking: Iterable[str]) -> Iterable[Mismatch]:
    """Yield a mismatch when the old run ended early and lacks these settings (`"AGENT under SETTING"`)."""
    told = list(lacking) if before.ended_early else []
    if told:
        text = f"not all tests of {before.label} came to their verdicts, and it lacks {first_of(told)}"
        yield Mismatch("routes", text, "Run the command of that run again")


def incomplete(label: str, cells: Iterable[Cell]) -> Iterable[Mismatch]:
    """Yield a mismatch when the old run lacks scores of these cells: with few scores nothing would get worse."""
    told = [f"under {cell.setting}: {cell.broken[0]}" for cell in cells if cell.broken]
    if told:
        yield Mismatch("routes", f"{label} is incomplete {first_of(told)}", "Run the command of that run again")


def stopped(label: str, cells: Iterable[Cell]) -> Iterable[Mismatch]:
    """Yield a mismatch when verdicts of the run were reached without some routes of these cells."""
    told = [f"{routes} under {cell.setting}" for cell in cells for routes in cell.stopped]
    if told:
        text = f"{label} was driven only until its verdicts were clear, so its scores cannot be compared"
        yield Mismatch(
            "routes", f"{text}: {first_of(told)}", "Drive that run with --drive-save or --drive-verdict=point"
        )


def not_driven(before: str, after: str, pairs: Iterable[tuple[Cell, Collection[str]]]) -> Iterable[Mismatch]:
    """Yield a mismatch when the new run lacks routes of the old run; `pairs` are (old cell, routes of the new run)."""
    told = [told for old, routes in pairs for told in _only_in(old, routes)]
    if told:
        yield Mismatch("routes", f"{after} lacks routes of {before}: {first_of(told)}", "Drive these routes, too")


def other_content(old: Cell, digests: Mapping[str, str]) -> Iterable[Mismatch]:
    """Yield a mismatch when routes of the new run, given by id and digest, differ from the old routes of equal id."""
    shared = [(route, old.routes[route].digest, digest) for route, digest in digests.items() if route in old.routes]
    others = [route for route, was, now in shared if was and now and was != now]
    if others:
        shown = first_few(others, _MOST_ROUTES)
        yield Mismatch("routes", f"{len(others)} of {len(shared)} routes have changed under the same id: {shown}")


def _only_in(one: Cell, other: Collection[str]) -> Iterable[str]:
    """Yield a sentence on the routes of `one` that `other` lacks, if any: how many, and which."""
    lacking = [route for route in one.routes if route not in other]
    if lacking:
        shown = first_few(lacking, _MOST_ROUTES)
        yield f"{len(lacking)} of {len(one.routes)} under {one.setting} ({shown})"
