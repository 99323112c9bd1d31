"""Compares two snapshots: verdicts, routes that flipped, and differences in how the two runs were driven."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import fmean

from pytest_drive_robust.errors import UsageError, first_few
from pytest_drive_robust.regression.allowance import Allowance
from pytest_drive_robust.regression.clean_settings import clean_sentence
from pytest_drive_robust.regression.comparison_result import CellComparison, Comparison, Finding, Flip, Numbers, Terms
from pytest_drive_robust.regression.fingerprint import Fingerprint, Mismatch, mismatches
from pytest_drive_robust.regression.shared_routes import Pair, Shared, other_content, pairs_of
from pytest_drive_robust.regression.snapshot import Cell, RouteScore, Snapshot
from pytest_drive_robust.regression.verdicts import Quartet, below_floor, judge_drop, judge_rise, rule_for
from pytest_drive_robust.stats.evidence import FEWEST_FOR_T


def compare(before: Snapshot, after: Snapshot, terms: Terms | None = None) -> Comparison:
    """Judge `after` against `before`, setting by setting, on the routes that both hold.

    Agents are matched by name; if each run has one agent and the names differ, these two agents are compared. A route
    of `before` that `after` lacks is a mismatch, because its result is unknown. A setting of `before` that `after`
    lacks is only a note, because people select tests.

    Raises `UsageError` when the two runs have no agent, setting and route in common, or only clean settings although
    nothing but a rise of RD is to be judged.
    """
    terms = terms or Terms()
    shared = Shared.of(before, after)
    if not shared.compared:
        raise UsageError(_nothing_in_common(before, after))
    require_more_than_rd_of_clean(terms.allowances, [new.setting for _, new in shared.compared])
    cells = tuple(_compared(before, after, cells, terms) for cells in shared.compared)
    found = [*shared.mismatches, *(item for cells in shared.compared for item in _cell_mismatches(*cells))]
    return Comparison(
        before=before,
        after=after,
        terms=terms,
        cells=cells,
        mismatches=tuple(dict.fromkeys(found)),
        notes=tuple(sorted((*shared.notes, *shared.lacking, *_about_rules(cells)))),
        unscored=tuple(f"{cell.name}: {_not_scored(cell)}" for cell in shared.unscored),
        elsewhere=len(shared.lacking),
    )


def require_more_than_rd_of_clean(allowances: Sequence[Allowance], settings: Sequence[str]) -> None:
    """Raise `UsageError` where nothing is judged: RD under each of the common `settings` is 0 in every run."""
    if all(item.metric == "RD" for item in allowances) and all(clean_sentence(name) == name for name in settings):
        raise UsageError(
            "there is nothing to judge: only a rise of RD is to fail, RD under clean is 0 in every run, and both runs "
            "hold no other setting. Let a drop of DS or SR fail, too, as in ds:-5%."
        )


def _nothing_in_common(before: Snapshot, after: Snapshot) -> str:
    def told(snapshot: Snapshot) -> str:
        cells = [f"{cell.name} ({len(cell.routes)} routes{_broken(cell)})" for cell in snapshot.cells.values()]
        return f"{snapshot.label} holds {first_few(cells, 4) or 'nothing'}"

    return f"there is nothing to compare: {told(before)}; {told(after)}. Expected a setting with common routes."


def _about_rules(cells: Sequence[CellComparison]) -> Iterable[str]:
    """Yield notes on verdicts that rest on few routes."""
    judged = [finding for cell in cells for finding in cell.findings]
    lists = sorted({item.routes for item in judged if item.rule == "list" and item.changed})
    if lists:
        yield f"verdicts on {_listed(lists)} routes by the rule list: they speak of exactly these routes and seeds"
    few = sorted({item.routes for item in judged if item.rule == "evidence" and item.routes < FEWEST_FOR_T})
    if few:
        seeds = "" if all(cell.same_seeds for cell in cells) else " with other seeds"
        yield f"{_listed(few)} routes{seeds} show little: drive {FEWEST_FOR_T} or more, or the same routes and seeds"


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(map(str, numbers))


def _broken(cell: Cell) -> str:
    return f", {len(cell.broken)} not scored: {cell.broken[0]}" if cell.broken else ""


def _not_scored(cell: Cell) -> str:
    return f"not scored: {first_few(cell.broken, 1)}"


def _compared(before: Snapshot, after: Snapshot, cells: tuple[Cell, Cell], terms: Terms) -> CellComparison:
    old, new = cells
    pairs = pairs_of(old, new)
    clean_pairs = _clean_pairs(before, after, cells, pairs)
    quartets = tuple(_quartet(*both) for both in clean_pairs)
    return CellComparison(
        agent=new.agent,
        agent_before=old.agent,
        setting=new.setting,
        routes_spec=new.routes_spec,
        before=_numbers([pair[0] for pair in pairs], [(item.clean_before, item.before) for item in quartets]),
        after=_numbers([pair[1] for pair in pairs], [(item.clean_after, item.after) for item in quartets]),
        routes=len(pairs),
        missing=len(old.routes) - len(pairs),
        added=len(new.routes) - len(pairs),
        changed=sum(was.ds != now.ds or was.sr != now.sr for was, now in pairs),
        quartets=() if old.broken or new.broken else quartets,
        findings=tuple(
            _finding(new, allowance, terms.rule, pairs, clean_pairs, quartets) for allowance in terms.allowances
        ),
        flips=_flips(pairs),
        same_seeds=_same_seeds(pairs),
    )


def _same_seeds(pairs: Iterable[Pair]) -> bool:
    return all(was.seeds == now.seeds for was, now in pairs)


def _numbers(scores: Sequence[RouteScore], clean_and_perturbed: Sequence[tuple[float, float]]) -> Numbers:
    clean = fmean(pair[0] for pair in clean_and_perturbed) if clean_and_perturbed else 0.0
    rd = 1.0 - fmean(pair[1] for pair in clean_and_perturbed) / clean if clean > 0.0 else None
    return Numbers(fmean(score.ds for score in scores), fmean(score.sr for score in scores), rd)


def _clean_pairs(
    before: Snapshot, after: Snapshot, cells: tuple[Cell, Cell], pairs: Sequence[Pair]
) -> list[tuple[Pair, Pair]]:
    """Return each pair with the clean pair of its route, if both runs have one; an empty list for a clean setting."""
    old, new = cells
    sentence = clean_sentence(new.setting)
    clean_old, clean_new = before.cells.get((old.agent, sentence)), after.cells.get((new.agent, sentence))
    if sentence == new.setting or clean_old is None or clean_new is None:
        return []
    return [
        ((was, now), (clean_old.routes[route], clean_new.routes[route]))
        for was, now in pairs
        if (route := now.route_id) in clean_old.routes and route in clean_new.routes
    ]


def _quartet(pair: Pair, clean_pair: Pair) -> Quartet:
    (was, now), (clean_was, clean_now) = pair, clean_pair
    (before, clean_before), (after, clean_after) = was.paired_with(clean_was), now.paired_with(clean_now)
    return Quartet(now.route_id, clean_before, before, clean_after, after)


def _finding(
    new: Cell,
    allowance: Allowance,
    asked: str,
    pairs: Sequence[Pair],
    clean_pairs: Sequence[tuple[Pair, Pair]],
    quartets: Sequence[Quartet],
) -> Finding:
    """Return the finding on one allowance, judged by the rule that fits the scores."""
    if new.broken:
        return Finding(allowance, "error", problem=_not_scored(new))
    if allowance.metric == "RD":
        return _rise(new, allowance, asked, clean_pairs, quartets)
    scores = [(was.ds, now.ds) if allowance.metric == "DS" else (was.sr, now.sr) for was, now in pairs]
    changed = sum(was != now for was, now in scores)
    rule = rule_for(asked, len(scores), same_seeds=_same_seeds(pairs), changed=changed)
    return Finding(allowance, judge_drop(scores, allowance, rule=rule), rule, len(scores), changed)


def _rise(
    new: Cell,
    allowance: Allowance,
    asked: str,
    clean_pairs: Sequence[tuple[Pair, Pair]],
    quartets: Sequence[Quartet],
) -> Finding:
    if not quartets:
        if clean_sentence(new.setting) == new.setting:
            return Finding(allowance, "pass")  # RD of a clean setting is 0 in every run
        return Finding(allowance, "error", problem="RD needs clean episodes of the same routes in both runs")
    changed = sum(item.clean_before != item.clean_after or item.before != item.after for item in quartets)
    same_seeds = _same_seeds(pair for both in clean_pairs for pair in both)
    rule = rule_for(asked, len(quartets), same_seeds=same_seeds, changed=changed)
    verdict = judge_rise(quartets, allowance, rule=rule)
    problem = below_floor(quartets) if verdict == "inconclusive" else ""
    return Finding(allowance, verdict, rule, len(quartets), changed, problem)


def _flips(pairs: Sequence[Pair]) -> tuple[Flip, ...]:
    """Return the routes that flipped: those that newly go wrong first, and the largest loss of driving score first."""
    flips = [Flip(was.succeeds, was, now) for was, now in pairs if was.succeeds != now.succeeds]
    return tuple(sorted(flips, key=lambda flip: (not flip.fails, flip.after.ds - flip.before.ds, flip.after.route_id)))


def _cell_mismatches(old: Cell, new: Cell) -> Iterable[Mismatch]:
    pairs = [(old.routes[route], score) for route, score in new.routes.items() if route in old.routes]
    seen: list[tuple[Fingerprint, Fingerprint]] = []
    for was, now in pairs:
        if (was.fingerprint, now.fingerprint) not in seen:
            seen.append((was.fingerprint, now.fingerprint))
            yield from mismatches(was.fingerprint, now.fingerprint, agent=new.agent)
    yield from other_content(old, {route: score.digest for route, score in new.routes.items()})
