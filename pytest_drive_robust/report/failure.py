"""The message of a requirement that does not hold, in at most 100 columns."""

from __future__ import annotations

import re
import shlex

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.metrics.summary import Summary
from pytest_drive_robust.options.run import DEFAULT_SIMULATOR, RunOptions
from pytest_drive_robust.report.numbers import counted, interval_text, shown, shown_beside
from pytest_drive_robust.report.page import WIDTH, cut
from pytest_drive_robust.report.promise import claims, confidence, shown_by_evidence
from pytest_drive_robust.simulators.routes import ships
from pytest_drive_robust.verdict.evaluate import Verdict
from pytest_drive_robust.verdict.explain import seconds_text


def failure_text(verdict: Verdict, options: RunOptions, *, routes_spec: str, privileged: bool) -> str:
    """Return the whole message: value and limit, summaries, worst routes, and the command that replays the worst."""
    lines = [*_headline(verdict), *_promise(verdict), *_summaries(verdict), *_worst(verdict)]
    if privileged:
        lines.append(f"  the agent {verdict.agent} is privileged: it sees ground truth")
    if verdict.worst and not options.is_external:
        command = replay_command(worst_episode(verdict), options, routes_spec=routes_spec)
        lines.append(f"  replay:  {command}")  # not shortened, because people copy the command
    return "\n".join(lines)


def worst_episode(verdict: Verdict) -> Episode:
    """Return the episode under the failure on the worst route of a verdict, which must have a worst route."""
    worst = verdict.worst[0]
    return Episode(verdict.agent, worst.route_id, str(verdict.requirement.setting), worst.seed)


def replay_command(episode: Episode, options: RunOptions, *, routes_spec: str) -> str:
    """Return the command line that drives one episode again, without options that equal their defaults."""
    words = ["drive-robust", *(word for plugin in options.plugins for word in ("-p", plugin))]
    words += ["replay", episode.route_id, "--agent", episode.agent, "--setting", episode.setting]
    words += ["--seed", str(episode.seed)]
    if routes_spec != options.simulator and not ships(routes_spec):
        words += ["--routes", routes_spec]
    if options.stuck_stop_s is not None:
        words += ["--stuck-stop", f"{options.stuck_stop_s:g}"]
    if options.simulator != DEFAULT_SIMULATOR:
        words += ["--sim", options.simulator]
    return " ".join(_quoted(word) for word in words)


def _headline(verdict: Verdict) -> list[str]:
    """Return value, limit, interval and numbers of routes and seeds, on two lines if one line is too long."""
    requirement = verdict.requirement
    metric = requirement.metric.name
    what = f"{metric} under {requirement.setting}"
    value = f" = {shown_beside(metric, verdict.value, requirement.limit)}"
    value += f", limit {requirement.comparison} {requirement.metric.format_limit(requirement.limit)}"
    sure = confidence(verdict.verdict_rule.kind, verdict.verdict_rule.alpha)
    limits = [requirement.limit, *([requirement.lenient_limit(verdict.verdict_rule)] if verdict.margin else [])]
    interval = interval_text(metric, verdict.low, verdict.high, *limits, confidence=sure)
    routes = counted(verdict.routes, "route")
    if verdict.routes < verdict.planned:
        routes = f"{verdict.routes} of {counted(verdict.planned, 'route')}"
    counts = f"{routes} x {counted(verdict.seeds, 'seed')}"
    counts += f", {verdict.without_data} without data" if verdict.without_data else ""
    line = f"{what}{value}   ({interval}, {counts})"
    if len(line) <= WIDTH:
        return [line]
    return [cut(what, WIDTH - len(value)) + value, f"  ({interval}, {counts})"]  # cut a long stack, but no number


def _promise(verdict: Verdict) -> list[str]:
    """Return what the verdict shows and how often it may be wrong; an empty list for a plain comparison."""
    requirement, kind = verdict.requirement, verdict.verdict_rule.kind
    if verdict.reason and verdict.decision == "inconclusive":  # a reason turns a pass, but no fail, into inconclusive
        return [f"  open: {verdict.reason}"]
    if kind == "list" and verdict.routes < verdict.planned:
        return [f"  decided for these {verdict.planned} routes and seeds before all were driven"]
    if kind != "evidence":
        return []
    verdict_rule, lenient = verdict.verdict_rule, requirement.lenient_limit(verdict.verdict_rule)
    broken, held = claims(requirement.metric, requirement.comparison, limit=requirement.limit, lenient=lenient)
    if (
        verdict.decision == "inconclusive"
        and verdict_rule.family > 1
        and (verdict.p_value or 1.0) <= verdict_rule.alpha
    ):
        return [
            f"  open: {broken} is shown on its own (p = {verdict.p_value:.2g}) but not among {verdict_rule.family} "
            "requirements yet",
            "  Holm's procedure decides when all of them are judged: see the end of the run",
        ]
    if verdict.decision == "inconclusive":
        told = counted(verdict.routes - verdict.without_data, "route") + (" with data" if verdict.without_data else "")
        return [f"  open: neither {broken} nor {held} is shown by {told}"]
    claim = broken if verdict.decision == "fail" else held
    said = shown_by_evidence(claim, verdict.decision, alpha=verdict_rule.alpha, family=verdict_rule.family)
    return [f"  shown: {said}"]


def _summaries(verdict: Verdict) -> list[str]:
    """Return driving score and success rate, beside the clean values if clean episodes were driven."""
    under = "clean" if verdict.requirement.setting.is_clean else "perturbed"
    columns: list[tuple[str, Summary]] = [(under, verdict.perturbed)]
    if verdict.clean is not None and under != "clean":
        columns.insert(0, ("clean", verdict.clean))
    lines = [
        " " * 8 + "".join(f"{name:>12}" for name, _ in columns),
        "  DS    " + "".join(f"{shown('DS', summary.ds):>12}" for _, summary in columns),
        "  SR    " + "".join(f"{shown('SR', summary.sr):>12}" for _, summary in columns),
    ]
    if verdict.routes < verdict.planned:  # the table's row has the routes of all verdicts on that setting
        read = counted(verdict.routes, "route")
        lines.append(f"  DS and SR of the {read} that this verdict read; the run's table has those of all its verdicts")
    errors = verdict.perturbed.agent_errors
    if errors:
        lines.append(f"  {counted(errors, 'episode')} of {verdict.perturbed.episodes} ended with an agent error")
    return lines


def _worst(verdict: Verdict) -> list[str]:
    """Return each worst route with its outcome, or with both outcomes and the second at which the twins diverged."""
    lines = ["  worst routes"] if verdict.worst else []
    under = "clean" if verdict.requirement.setting.is_clean else "perturbed"
    compared = verdict.clean is not None and under != "clean"
    metric = verdict.requirement.metric.name

    def of(value: float | None) -> str:
        return "" if value is None else f"{metric} {shown(metric, value)}, "

    for item in verdict.worst:
        head = f"  {item.route_id} {item.scenario}" + (f", seed {item.seed}" if verdict.seeds > 1 else "")
        if not compared:
            lines += [head, _story(under, item.perturbed_score, item.perturbed_outcome, of(item.perturbed_value))]
            continue
        parted = "" if item.diverged_s is None else f", diverged at {seconds_text(item.diverged_s)} {item.diverged_by}"
        lines += [
            cut(head, WIDTH - len(parted)) + parted,
            _story("clean", item.clean_score, item.clean_outcome, of(item.clean_value)),
            _story("perturbed", item.perturbed_score, item.perturbed_outcome, of(item.perturbed_value)),
        ]
    return lines


def _story(under: str, score: float | None, outcome: str, value: str) -> str:
    return cut(f"    {under:<9} {'-' if score is None else f'{score:.1f}':>6}  {value}{outcome}")


def _quoted(word: str) -> str:
    """Return a word quoted if a shell needs it; double quotes if possible, which all common shells read alike."""
    if re.fullmatch(r"[\w@%+=:,./-]+", word):
        return word
    return shlex.quote(word) if re.search(r"[\"$`\\!]", word) else f'"{word}"'
