"""The comparison of two runs as text of at most 100 columns: the table, the routes that flipped, the conclusion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.errors import first_few
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.regression.comparison_result import CellComparison, Comparison, Finding, Flip
from pytest_drive_robust.regression.snapshot import RouteScore
from pytest_drive_robust.regression.verdicts import Rise
from pytest_drive_robust.report.failure import replay_command
from pytest_drive_robust.report.numbers import beside, counted, shown
from pytest_drive_robust.report.page import WIDTH, Page, cut

_MOST_FAILING, _MOST_PASSING, _MOST_NOTES = 5, 3, 10


def comparison_text(comparison: Comparison, *, colour: bool, width: int = WIDTH) -> str:
    """Return the text of a comparison; for a refused comparison only the reasons.

    `colour` adds terminal escapes; `width` is the number of columns.
    """
    page = Page(colour=colour, width=width)
    for line in _fingerprint_lines(comparison):
        page.print(line, wraps=False)
    if not comparison.refusals:
        page.table(("DS", "SR", "RD", "routes"), map(_row, comparison.cells), agent_width=14)
        for line in (
            *(f"error: {told}" for told in comparison.unscored),
            *_stories(comparison),
            *_mean_lines(comparison),
        ):
            page.print(line, wraps=False)
    page.print(conclusion(comparison), wraps=False)
    return page.text


def conclusion(comparison: Comparison) -> str:
    """Return one line with the result that the exit code stands for, and the reason."""
    label = comparison.before.label
    if comparison.refusals:
        return (
            f"NOT COMPARED with {label}: {comparison.refusals[0].text}. {comparison.refusals[0].advice}, or give "
            "--on-mismatch=warn (in pytest --drive-on-mismatch=warn)."
        )
    unsure = sum(cell.verdict == "inconclusive" for cell in comparison.cells)
    count = counted(len(comparison.cells) + len(comparison.unscored), "setting")
    unjudged = comparison.unjudged
    if comparison.regressions:
        worse = [cell.name for cell in comparison.regressions]
        told = f"REGRESSION: {len(worse)} of {count} against {label}: {first_few(worse, 1)}"
        return f"{told}; {len(unjudged)} not judged" if unjudged else told
    if unjudged:
        return f"NOT JUDGED: {len(unjudged)} of {count} against {label}: {first_few(unjudged, 1)}"
    if comparison.terms.open_fails and comparison.open:
        unclear = [cell.name for cell in comparison.open]
        return f"INCONCLUSIVE: {len(unclear)} of {count} against {label}: {first_few(unclear, 1)}"
    part = _part(comparison)
    if all(cell.same_seeds and not cell.changed for cell in comparison.cells):
        if part:
            return f"no regression {part} against {label}: not one score changed"
        return f"no regression: not one score changed in {count} against {label}"
    return f"no regression shown {part or f'in {count}'} against {label}" + (
        f", {unsure} inconclusive" if unsure else ""
    )


def _part(comparison: Comparison) -> str:
    """Return the compared part, as in `"on 5 of 30 routes in 2 of 3 settings"`; empty if all routes were compared."""
    cells = comparison.cells
    settings = counted(len(cells) + comparison.elsewhere, "setting")
    if comparison.elsewhere:
        settings = f"{len(cells)} of {settings}"
    compared, held = sum(cell.routes for cell in cells), sum(cell.all_routes for cell in cells)
    if compared == held:
        return f"in {settings}" if comparison.elsewhere else ""
    if len({(cell.routes, cell.all_routes) for cell in cells}) == 1:
        return f"on {cells[0].routes} of {cells[0].all_routes} routes in {settings}"
    return f"on {compared} of {counted(held, 'score')} in {settings}"


def _fingerprint_lines(comparison: Comparison) -> Iterator[str]:
    before, after = comparison.before, comparison.after
    made = [f"{item.label} ({item.made})" if item.made else item.label for item in (before, after)]
    yield f"{made[0]} -> {made[1]}"
    for item in comparison.mismatches:
        word = "refused" if item in comparison.refusals else "note" if item.kind == "agent" else "warning"
        yield f"{word}: {item.text}"
    yield from (f"note: {note}" for note in comparison.notes[:_MOST_NOTES])
    if len(comparison.notes) > _MOST_NOTES:
        yield f"note: and {len(comparison.notes) - _MOST_NOTES} more"


def _row(cell: CellComparison) -> tuple[str, ...]:
    return (
        cell.agent,
        cell.setting,
        f"{cell.before.ds:.1f} -> {cell.after.ds:.1f}",
        f"{shown('SR', cell.before.sr)} -> {shown('SR', cell.after.sr)}",
        "-" if cell.after.rd is None else f"{shown('RD', cell.before.rd)} -> {shown('RD', cell.after.rd)}",
        str(cell.routes) if cell.routes == cell.all_routes else f"{cell.routes} of {cell.all_routes}",
        cell.verdict,
    )


def _stories(comparison: Comparison) -> Iterator[str]:
    """Yield the lines that explain each verdict other than a pass, and each flip."""
    for cell in comparison.cells:
        broken = [item for item in cell.findings if item.verdict in ("fail", "error") or item.is_open or item.problem]
        if not broken and not cell.flips:
            continue
        with_clean = max(item.changed for item in cell.findings)
        clean = f", {with_clean} with their clean scores" if with_clean > cell.changed else ""
        yield f"{cell.name}: {cell.changed} of {counted(cell.routes, 'route')} changed{clean}"
        if (rise := cell.rise) is not None:
            yield f"  RD {_change(rise)}"
        for finding in broken:
            yield f"  {_finding(cell, finding)}"
            if finding.verdict == "inconclusive" and finding.problem:
                yield f"    {finding.problem}"
        failing = [flip for flip in cell.flips if flip.fails]
        passing = [flip for flip in cell.flips if not flip.fails]
        yield from _flips(cell, failing, most=_MOST_FAILING)
        yield from _flips(cell, passing, most=_MOST_PASSING)


def _mean_lines(comparison: Comparison) -> Iterator[str]:
    if not any(cell.changed for cell in comparison.cells):
        return
    for agent, rise in comparison.mean_rises.items():
        yield f"{agent}: mean RD of {rise.settings} settings {_change(rise)} on {counted(rise.routes, 'route')}"


def _change(rise: Rise) -> str:
    interval = f"{rise.low:+.3f} to {rise.high:+.3f}"
    return f"{rise.before:.3f} -> {rise.after:.3f} ({rise.after - rise.before:+.3f}, 95 % {interval})"


def _finding(cell: CellComparison, finding: Finding) -> str:
    allowance = finding.allowance
    if finding.verdict == "error":
        return f"error: {finding.problem}"
    before, after = (getattr(numbers, allowance.metric.lower()) for numbers in (cell.before, cell.after))
    change = f"{shown(allowance.metric, before)} -> {shown(allowance.metric, after)}"
    worst = allowance.amount if allowance.metric == "RD" else -allowance.amount
    if not allowance.relative:
        change += f" ({beside(after - before, worst, sign='+')})"
    elif before > 0.0:
        change += f" ({beside(100.0 * (after / before - 1.0), 100.0 * worst, decimals=1, sign='+')} %)"
    words = {"fail": "broken", "inconclusive": "left open" if finding.problem else "neither shown nor ruled out"}
    return f"{words[finding.verdict]}: {allowance.sentence}; {change} on {counted(finding.routes, 'route')}"


def _flips(cell: CellComparison, flips: Sequence[Flip], *, most: int) -> Iterator[str]:
    word = "newly going wrong" if flips and flips[0].fails else "newly without a fault"  # all flip the same way
    for flip in flips[:most]:
        yield f"  {word}: {flip.after.route_id} {flip.after.scenario}"
        yield _story("was", flip.before)
        yield _story("is", flip.after)
        if flip.fails and cell.routes_spec:  # without a specification, the file of the route is unknown
            yield from _replay(cell, flip.after)
    if len(flips) > most:
        rest = ", ".join(flip.after.route_id for flip in flips[most : most + 10])
        more = " ..." if len(flips) > most + 10 else ""
        yield f"  and {len(flips) - most} more {word}: {rest}{more}"


def _story(word: str, score: RouteScore) -> str:
    return cut(f"    {word:<4}{score.ds:6.1f}  {score.outcome}")


def _replay(cell: CellComparison, score: RouteScore) -> Iterator[str]:
    fingerprint = score.fingerprint
    options = RunOptions(
        simulator=fingerprint.simulator,
        stuck_stop_s=fingerprint.stuck_stop_s,
        plugins=fingerprint.plugins,
    )
    if options.is_external:
        return
    episode = Episode(cell.agent, score.route_id, cell.setting, score.worst_seed)
    yield f"    replay:  {replay_command(episode, options, routes_spec=cell.routes_spec)}"
