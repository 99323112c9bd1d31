"""Why a requirement does not hold, in at most 100 columns."""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING

from pytest_drive_robust.report.numbers import interval_text, shown
from pytest_drive_robust.settings import DEFAULT_SIMULATOR, Settings

if TYPE_CHECKING:
    from pytest_drive_robust.metrics.summary import Summary
    from pytest_drive_robust.requirements.evaluate import Verdict, WorstRoute

__all__ = ["WIDTH", "failure_text", "replay_command", "value_text"]

WIDTH = 100
_OUTCOME = 27


def failure_text(verdict: Verdict, settings: Settings, *, routes_spec: str, privileged: bool) -> str:
    """The whole message: value and limit, summaries, worst routes, and the command that replays the worst."""
    lines = [
        *_headline(verdict),
        *_summaries(verdict),
        *_worst(verdict),
    ]
    if privileged:
        lines.append(f"  the agent {verdict.agent} is privileged: it sees ground truth")
    if verdict.worst:
        setting = str(verdict.requirement.setting)
        command = replay_command(verdict.worst[0], verdict.agent, setting, settings, routes_spec=routes_spec)
        lines.append(f"  replay:  {command}")  # never shortened: it is there to be copied
    return "\n".join(lines)


def value_text(metric: str, setting: str, value: float) -> str:
    """`"RD under 200 ms latency = 0.44"`."""
    return f"{metric} under {setting} = {shown(metric, value)}"


def replay_command(worst: WorstRoute, agent: str, setting: str, settings: Settings, *, routes_spec: str) -> str:
    """The command line that drives one episode again. Options are left out where the defaults say the same."""
    words = ["drive-robust", "replay", worst.route_id, "--agent", agent, "--setting", setting]
    words += ["--seed", str(worst.seed)]
    if routes_spec != Settings().routes:
        words += ["--routes", routes_spec]
    if settings.simulator != DEFAULT_SIMULATOR:
        words += ["--sim", settings.simulator]
    return " ".join(_quoted(word) for word in words)


def _headline(verdict: Verdict) -> list[str]:
    """Value, limit, interval, numbers of routes and seeds; on two lines where one is too narrow."""
    requirement = verdict.requirement
    metric = requirement.metric
    value = value_text(metric, str(requirement.setting), verdict.value)
    limit = f"limit {requirement.comparison} {shown(metric, requirement.limit)}"
    interval = interval_text(metric, verdict.low, verdict.high)
    counts = f"{_count(verdict.routes, 'route')} x {_count(verdict.seeds, 'seed')}"
    line = f"{value}, {limit}   ({interval}, {counts})"
    return [line] if len(line) <= WIDTH else [_cut(f"{value}, {limit}", WIDTH), f"  ({interval}, {counts})"]


def _summaries(verdict: Verdict) -> list[str]:
    """Driving score and success rate, side by side with the clean ones where those were driven."""
    under = "clean" if verdict.requirement.setting.is_clean else "perturbed"
    columns: list[tuple[str, Summary]] = [(under, verdict.perturbed)]
    if verdict.clean is not None and under != "clean":
        columns.insert(0, ("clean", verdict.clean))
    lines = [
        " " * 8 + "".join(f"{name:>12}" for name, _ in columns),
        "  DS    " + "".join(f"{shown('DS', summary.ds):>12}" for _, summary in columns),
        "  SR    " + "".join(f"{shown('SR', summary.sr):>12}" for _, summary in columns),
    ]
    errors = verdict.perturbed.agent_errors
    if errors:
        lines.append(f"  {_count(errors, 'episode')} of {verdict.perturbed.episodes} ended with an agent error")
    return lines


def _worst(verdict: Verdict) -> list[str]:
    """A line for each of the worst routes: both scores, both outcomes, and when the two drives parted."""
    if not verdict.worst:
        return []
    several_seeds = verdict.seeds > 1
    names = [
        f"{item.route_id} {item.scenario}" + (f" seed {item.seed}" if several_seeds else "") for item in verdict.worst
    ]
    compared = verdict.clean is not None and not verdict.requirement.setting.is_clean
    width = min(max(len(name) for name in names), 30)
    head = f"  {'worst routes':<{width}}  "
    if not compared:
        rows = [
            f"  {_cut(name, width):<{width}}  {_drive(item.perturbed_score, item.perturbed_outcome)}".rstrip()
            for name, item in zip(names, verdict.worst, strict=True)
        ]
        return [head.rstrip(), *(_cut(row, WIDTH) for row in rows)]
    first = max(min(max(len(item.clean_outcome) for item in verdict.worst), _OUTCOME), 9)
    second = max(min(max(len(item.perturbed_outcome) for item in verdict.worst), WIDTH - width - first - 28), 9)
    head += f"{'clean':<{first + 6}}  {'perturbed':<{second + 6}}  diverged"
    rows = [
        f"  {_cut(name, width):<{width}}  {_drive(item.clean_score, item.clean_outcome, first)}  "
        f"{_drive(item.perturbed_score, item.perturbed_outcome, second)}  {_seconds(item.diverged_s)}"
        for name, item in zip(names, verdict.worst, strict=True)
    ]
    return [head, *rows]


def _drive(score: float | None, outcome: str, width: int = _OUTCOME * 2) -> str:
    return f"{'-' if score is None else f'{score:.1f}':>5} {_cut(outcome, width):<{width}}"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f} s"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 3] + "..."


def _quoted(word: str) -> str:
    """Double quotes where the shell needs any: they mean the same in every shell that people use."""
    if re.fullmatch(r"[\w@%+=:,./-]+", word):
        return word
    return shlex.quote(word) if re.search(r"[\"$`\\!]", word) else f'"{word}"'
