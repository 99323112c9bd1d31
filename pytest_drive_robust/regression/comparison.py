"""One snapshot against another: verdicts, routes that flipped, and what the two were driven with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.regression.allowance import Allowance
from pytest_drive_robust.regression.comparison_result import CellComparison, Comparison, Finding, Flip, Numbers, Terms
from pytest_drive_robust.regression.fingerprint import Fingerprint, Mismatch, mismatches
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot
from pytest_drive_robust.regression.verdicts import Quartet, judge_drop, judge_rise, kind_for
from pytest_drive_robust.runner.plan import planned_order
from pytest_drive_robust.stats.evidence import FEWEST_FOR_T
from pytest_drive_robust.stats.judges import VerdictKind

Pair = tuple[RouteScore, RouteScore]


def compare(before: Snapshot, after: Snapshot, terms: Terms | None = None) -> Comparison:
    """Judge `after` against `before`, setting by setting, on the routes that both hold.

    Agents are matched by name; where each run has one agent and the names differ, these two are compared.

    Raises `UsageError` when the two have no agent, setting and route in common.
    """
    terms = terms or Terms()
    renamed = _renamed(before, after)
    cells, found, notes, unscored = [], list[Mismatch](), list[str](), list[str]()
    if renamed:
        notes.append(f"{' and '.join(renamed.values())} is compared with {' and '.join(renamed)}")
    for (agent, setting), new in after.cells.items():
        old = before.cells.get((renamed.get(agent, agent), setting))
        if old is not None and new.broken and not new.routes:
            unscored.append(f"{agent} under {setting}: {_not_scored(new)}")
            continue
        if old is None or not _pairs(old, new):
            what = "" if old is None else " on the same routes"
            notes.append(f"not in {before.label}{what}: {agent} under {setting}")
            continue
        cells.append(_compared(before, after, (old, new), terms))
        found += _cell_mismatches(old, new)
    driven = {(renamed.get(agent, agent), setting) for agent, setting in after.cells}
    notes += [f"not in {after.label}: {agent} under {setting}" for agent, setting in before.cells.keys() - driven]
    if not cells:
        raise UsageError(_nothing_in_common(before, after))
    notes += _about_rules(cells)
    first = next(score for cell in after.cells.values() for score in cell.routes.values())
    return Comparison(
        before=before,
        after=after,
        terms=terms,
        cells=tuple(cells),
        mismatches=tuple(dict.fromkeys(found)),
        fingerprint=first.fingerprint,
        notes=tuple(sorted(notes)),
        unscored=tuple(unscored),
    )


def _renamed(before: Snapshot, after: Snapshot) -> Mapping[str, str]:
    """Map the new name to the old one, where each run has one agent and they differ."""
    if len(before.agents) == len(after.agents) == 1 and before.agents != after.agents:
        return {after.agents[0]: before.agents[0]}
    return {}


def _nothing_in_common(before: Snapshot, after: Snapshot) -> str:
    def told(snapshot: Snapshot) -> str:
        cells = list(snapshot.cells.values())
        shown = ", ".join(
            f"{cell.agent} under {cell.setting} ({len(cell.routes)} routes{_broken(cell)})" for cell in cells[:4]
        )
        more = f" and {len(cells) - 4} more" if len(cells) > 4 else ""
        return f"{snapshot.label} holds {shown or 'nothing'}{more}"

    return f"there is nothing to compare: {told(before)}; {told(after)}. Expected a setting with common routes."


def _about_rules(cells: Sequence[CellComparison]) -> Iterable[str]:
    """Say what few routes mean."""
    lists = sorted({cell.routes for cell in cells if cell.rule == "list" and cell.changed})
    if lists:
        yield f"verdicts on {_listed(lists)} routes by the rule list: they speak of exactly these routes and seeds"
    few = sorted({cell.routes for cell in cells if cell.rule == "evidence" and cell.routes < FEWEST_FOR_T})
    if few:
        seeds = "" if all(cell.same_seeds for cell in cells) else " with other seeds"
        yield f"{_listed(few)} routes{seeds} show little: drive {FEWEST_FOR_T} or more, or the same routes and seeds"


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(map(str, numbers))


def _broken(cell: Cell) -> str:
    return f", {len(cell.broken)} not scored: {cell.broken[0]}" if cell.broken else ""


def _not_scored(cell: Cell) -> str:
    more = f" and {len(cell.broken) - 1} more" if len(cell.broken) > 1 else ""
    return f"not scored: {cell.broken[0]}{more}"


def _pairs(old: Cell, new: Cell) -> list[Pair]:
    """Return the routes that both hold, in the planned order of the setting."""
    common = [route for route in new.routes if route in old.routes]
    types = [new.routes[route].scenario for route in common]
    order = planned_order(common, types, f"{new.agent} {new.setting}")
    return [(old.routes[route], new.routes[route]) for route in order]


def _compared(before: Snapshot, after: Snapshot, cells: tuple[Cell, Cell], terms: Terms) -> CellComparison:
    old, new = cells
    pairs = _pairs(old, new)
    quartets = _quartets(before, after, cells, pairs)
    same_seeds = all(was.seeds == now.seeds for was, now in pairs)
    changed = sum(was.ds != now.ds for was, now in pairs)
    kind = kind_for(terms.kind, len(pairs), same_seeds=same_seeds, changed=changed)
    return CellComparison(
        agent=new.agent,
        agent_before=old.agent,
        setting=new.setting,
        routes_spec=new.routes_spec,
        before=_numbers([pair[0] for pair in pairs], [(item.clean_before, item.before) for item in quartets]),
        after=_numbers([pair[1] for pair in pairs], [(item.clean_after, item.after) for item in quartets]),
        routes=len(pairs),
        missing=len(old.routes) - len(pairs),
        changed=changed,
        quartets=() if old.broken or new.broken else quartets,
        findings=tuple(_findings(new, pairs, quartets, terms.allowances, kind)),
        flips=_flips(pairs),
        rule=kind,
        same_seeds=same_seeds,
    )


def _numbers(scores: Sequence[RouteScore], clean_and_perturbed: Sequence[tuple[float, float]]) -> Numbers:
    clean = fmean(pair[0] for pair in clean_and_perturbed) if clean_and_perturbed else 0.0
    rd = 1.0 - fmean(pair[1] for pair in clean_and_perturbed) / clean if clean > 0.0 else None
    return Numbers(fmean(score.ds for score in scores), fmean(score.sr for score in scores), rd)


def _quartets(
    before: Snapshot, after: Snapshot, cells: tuple[Cell, Cell], pairs: Sequence[Pair]
) -> tuple[Quartet, ...]:
    """Return the routes that have clean scores in both runs too; none for a clean setting."""
    old, new = cells
    sentence = _clean_sentence(new.setting)
    clean_old, clean_new = before.cells.get((old.agent, sentence)), after.cells.get((new.agent, sentence))
    if sentence == new.setting or clean_old is None or clean_new is None:
        return ()
    return tuple(
        Quartet(route, clean_old.routes[route].ds, was.ds, clean_new.routes[route].ds, now.ds)
        for was, now in pairs
        if (route := now.route_id) in clean_old.routes and route in clean_new.routes
    )


def _findings(
    new: Cell, pairs: Sequence[Pair], quartets: Sequence[Quartet], allowances: Sequence[Allowance], kind: VerdictKind
) -> Iterable[Finding]:
    for allowance in allowances:
        if new.broken:
            yield Finding(allowance, "error", _not_scored(new))
        elif allowance.metric == "RD":
            yield _rise(new, quartets, allowance, kind)
        else:
            ds = allowance.metric == "DS"
            scores = [(was.ds, now.ds) if ds else (was.sr, now.sr) for was, now in pairs]
            yield Finding(allowance, judge_drop(scores, allowance, kind=kind))


def _rise(new: Cell, quartets: Sequence[Quartet], allowance: Allowance, kind: VerdictKind) -> Finding:
    if quartets:
        return Finding(allowance, judge_rise(quartets, allowance, kind=kind))
    if _clean_sentence(new.setting) == new.setting:
        return Finding(allowance, "pass")  # RD of a clean setting is 0 in every run
    return Finding(allowance, "error", "RD needs clean episodes of the same routes in both runs")


def _clean_sentence(setting: str) -> str:
    """Return the sentence of the clean drive that `setting` is compared with.

    That is `"clean"`, or a clean drive with the same warm-up; `"clean"` too for sentences with perturbations of a user.
    """
    try:
        return str(Setting.parse(setting).baseline)
    except UsageError:  # stored runs are compared where the user's classes need not be importable
        return str(Setting.CLEAN)


def _flips(pairs: Sequence[Pair]) -> tuple[Flip, ...]:
    """Return the routes that flipped, newly failing ones first, the largest loss of driving score first."""
    flips = [Flip(was.succeeds, was, now) for was, now in pairs if was.succeeds != now.succeeds]
    return tuple(sorted(flips, key=lambda flip: (not flip.fails, flip.after.ds - flip.before.ds, flip.after.route_id)))


def _cell_mismatches(old: Cell, new: Cell) -> Iterable[Mismatch]:
    pairs = [(old.routes[route], score) for route, score in new.routes.items() if route in old.routes]
    seen: list[tuple[Fingerprint, Fingerprint]] = []
    for was, now in pairs:
        if (was.fingerprint, now.fingerprint) not in seen:
            seen.append((was.fingerprint, now.fingerprint))
            yield from mismatches(was.fingerprint, now.fingerprint, agent=new.agent)
    others = [now.route_id for was, now in pairs if was.digest and now.digest and was.digest != now.digest]
    if others:
        shown = ", ".join(others[:5]) + (f" and {len(others) - 5} more" if len(others) > 5 else "")
        yield Mismatch("routes", f"{len(others)} of {len(pairs)} routes are others by the same id: {shown}")
