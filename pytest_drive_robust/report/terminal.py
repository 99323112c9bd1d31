"""The table at the end of a run: agent x setting, in at most 100 columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.report.cautions import cautions
from pytest_drive_robust.report.failure import replay_command
from pytest_drive_robust.report.numbers import in_percent, legible, lower_end, shown, shown_beside
from pytest_drive_robust.report.page import WIDTH, Page
from pytest_drive_robust.report.promise import OPEN
from pytest_drive_robust.report.run_result import RunResult, SettingRow, row_labels
from pytest_drive_robust.stats.multiple_verdicts import any_wrong
from pytest_drive_robust.store.events import Judged

_MAX_ERRORS = 10
_REPLAY = "  replay"
_COLUMNS = ("DS", "SR", "RD", "efficiency", "comfort", "routes")
_NARROW_COLUMNS = ("DS", "SR", "RD", "routes")
_MOST_OTHERS = 2
"""How many other metrics fit into a line; JSON has all metrics."""


def run_summary(run: RunResult, *, colour: bool, width: int = WIDTH) -> str:
    """Return the table with its footnotes; empty when the run has no rows.

    `colour` adds terminal escapes; `width` is the number of columns.
    """
    if not run.rows:
        return ""
    page = Page(colour=colour, width=width)
    columns = columns_of(run)
    page.table(columns, rows_of(run, columns), setting_width=40)
    for line in footnotes(run):
        page.print(line, wraps=not line.startswith(_REPLAY))
    return legible(page.text, controls=colour)


def rows_of(run: RunResult, columns: Sequence[str]) -> list[tuple[str, ...]]:
    """Return agent, setting, the numbers of `columns` and the verdict of each row, as text for a table."""
    labels = row_labels([(row.setting, row.routes_spec, row.seeds) for row in run.rows])
    return [
        (row.agent + ("*" if row.privileged else ""), label, *_numbers(row, columns), row.verdict)
        for label, row in zip(labels, run.rows, strict=True)
    ]


def columns_of(run: RunResult) -> tuple[str, ...]:
    """Return the names of the number columns: the usual ones and other metrics that requirements name.

    Efficiency and comfort are left out, unless a requirement names them, to make room for other metrics, or for the
    intervals of DS and RD in rows whose verdicts came before all routes were driven.
    """
    judged = _judged(run)
    others = _others(run)[:_MOST_OTHERS]
    if not others and not any(row.is_partial for row in run.rows):
        return _COLUMNS
    usual = [name for name in _COLUMNS if name in _NARROW_COLUMNS or name in judged]
    return (*usual[:-1], *others, usual[-1])


def _judged(run: RunResult) -> list[str]:
    """Return the metrics that requirements name, each once."""
    return list(dict.fromkeys(name for row in run.rows for name in row.judged))


def _others(run: RunResult) -> list[str]:
    """Return the metrics that requirements name and that are no usual column."""
    return [name for name in _judged(run) if name not in _COLUMNS]


def _numbers(row: SettingRow, columns: Sequence[str]) -> list[str]:
    """Return the metrics and the count of routes that `columns` name, as text."""
    summary = row.summary
    routes = f"{row.routes}/{row.planned}" if row.is_partial else str(row.routes)
    if len(row.seeds) > 1:
        routes += f" x {len(row.seeds)}"
    if len(row.results) < row.needed:
        routes = f"{len(row.results)} of {row.needed}"
    numbers = {name: shown(name, value) for name, value in row.judged.items()} | {"routes": routes}
    if summary is not None:
        numbers |= {
            "DS": shown("DS", summary.ds) + _between(row.ds_interval, "{:.0f}".format),
            "SR": shown("SR", summary.sr),
            "RD": shown("RD", row.rd) + _between(row.rd_interval, partial(lower_end, "RD")),
            "efficiency": shown("efficiency", summary.efficiency),
        }
        if "comfort" in columns:  # expensive: comfort reads the trace of every episode
            numbers["comfort"] = shown("comfort", summary.comfort)
    return [numbers.get(name, "-") for name in columns]


def _between(interval: tuple[float, float] | None, form: Callable[[float], str]) -> str:
    """Return an interval as `" (0.24 to 0.45)"`, or an empty string for None."""
    return "" if interval is None else f" ({form(interval[0])} to {form(interval[1])})"


def footnotes(run: RunResult) -> list[str]:
    """Return the footnotes of the table, one sentence or line each."""
    lines = []
    left_out = _others(run)[_MOST_OTHERS:]
    if left_out:
        lines.append(f"no column is left for {', '.join(left_out)}: --drive-json FILE has the values")
    if any(row.privileged for row in run.rows):
        lines.append("* privileged: this agent sees ground truth")
    if any(len(row.results) < row.needed for row in run.rows):
        lines.append("'n of m' are episodes: the run ended before the others were driven, or a verdict was an error")
    stuck = sum(result.end is End.STUCK for result in run.episodes.values())
    if stuck:
        lines.append(f"{stuck} of {len(run.episodes)} episodes were stopped early because the ego stood still")
    if any(row.is_partial for row in run.rows):
        confidence = 1.0 - 2.0 * run.options.verdict_rule.alpha
        lines.append(
            "'n/m' routes: the verdicts were clear after n of m routes (a failing test shows the routes of its own "
            "verdict, maybe fewer); in brackets what DS and RD may be on routes like these "
            f"({in_percent(confidence)} % intervals). Between rows compare RD (paired by route), not DS. All routes, "
            "with efficiency and comfort: --drive-verdict=point"
        )
    lines += [f"NOT GREEN: {item.agent}: {item.requirement}: {_value(item)}, {item.message}" for item in run.late]
    lines += _open(run)
    lines += cautions(run)
    lines += _several(run)
    lines += list(dict.fromkeys(f"{searched.agent}: {searched.sentence}" for searched in run.searched))
    lines += _errors(run, Outcome.AGENT_ERROR, "agent error")
    lines += _errors(run, Outcome.INFRA_ERROR, "simulation error, never scored")
    return lines + list(run.notes)


def _several(run: RunResult) -> list[str]:
    """Return how often the verdicts of this run, taken together, are wrong."""
    shared = [item for item in run.judged if item.p_value is not None]
    if len(shared) < 2:
        return []
    alpha, count = run.options.verdict_rule.alpha, len(shared)
    rarely = f"{in_percent(alpha)}% of the time"
    others = len(run.judged) - count
    lines = [
        f"{count} verdicts from evidence: when all pass, 'all hold' is wrong at most {rarely}, however many there are;"
    ]
    if run.options.correction == "none":
        often = in_percent(float(f"{any_wrong(alpha, count):.2g}"))
        lines.append(
            f"  'any fails' is wrong up to {often}% of the time, if every limit lies exactly at the agent's value, and "
            f"hardly ever with 0.05 of the range to spare (--drive-correction=holm: at most {in_percent(alpha)}%)"
        )
    else:
        planned = max(item.family for item in shared)
        lines.append(f"  'any fails' is wrong at most {rarely} (Holm over {max(count, planned)})")
        if count > planned:
            lines.append(
                f"  but only {planned} were counted when the tests were collected, so fails before the end were "
                f"corrected for {planned}: give requirements to tests as parameters"
            )
    if others:
        lines.append(f"  {others} more by the rules list and point, which speak of these routes only, or not judged")
    return lines


def _open(run: RunResult) -> list[str]:
    """Return a line for each inconclusive verdict, with its reason."""
    lines = []
    for judged in run.judged:
        if judged.verdict == "inconclusive":
            why = judged.message or OPEN
            read = f"{_value(judged)} after {judged.routes} of {judged.planned} routes"
            lines.append(f"~ {judged.agent}: {judged.requirement}: {read}, {why}")
    return lines


def _value(judged: Judged) -> str:
    """Return the value of a requirement as text, with enough decimals to differ from the limit beside it."""
    return shown_beside(judged.metric, judged.value, judged.limit)


def _errors(run: RunResult, outcome: Outcome, name: str) -> list[str]:
    """Return a line for each reason of an error, with the number of episodes and the first episode, and its replay."""
    reasons: dict[str, list[EpisodeResult]] = {}
    for result in run.episodes.values():
        if result.outcome is outcome:
            reasons.setdefault(result.end_detail, []).append(result)
    lines = []
    for reason, results in list(reasons.items())[:_MAX_ERRORS]:
        lines.append(f"{len(results)} x {name}: {reason} ({_first(results)})")
        lines += _replay(run, results[0])
    hidden = len(reasons) - _MAX_ERRORS
    return lines + ([f"and {hidden} more kinds of {name}"] if hidden > 0 else [])


def _first(results: Sequence[EpisodeResult]) -> str:
    return f"{'first ' if len(results) > 1 else ''}{results[0].episode}"


def _replay(run: RunResult, result: EpisodeResult) -> list[str]:
    """Return how far an episode came and the command that drives it again; an empty list with an external simulator."""
    specs = (row.routes_spec for row in run.rows if any(result is item for item in row.results))
    routes_spec = next(specs, None)
    if routes_spec is None or run.options.is_external:
        return []
    command = replay_command(result.episode, run.options, routes_spec=routes_spec)
    return [f"{_REPLAY} (it ended after {result.ticks} ticks):  {command}"]
