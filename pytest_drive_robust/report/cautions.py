"""Warnings that every report gives beside the numbers of a run: numbers that show less than they seem to."""

from __future__ import annotations

from collections import Counter

from pytest_drive_robust.domain.result import MACHINE_FACTS
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.verdict.touched import immunity

_BETTER = {"RD": "<=", "DS": ">=", "SR": ">="}
"""The comparison that demands a good agent. Other metrics may be limited from both sides."""
_MOST = 10


def cautions(run: RunResult) -> list[str]:
    """Return a sentence for each reason to be careful with a number of the run."""
    return [*_mistaken(run), *(note for row in run.rows if (note := immunity(row.results))), *_mixed_machines(run)]


def _mistaken(run: RunResult) -> list[str]:
    """Return warnings on passed requirements that are probably mistakes: `<=` for `>=`, a share for points of DS."""
    lines = []
    for judged in run.judged:
        better = _BETTER.get(judged.metric)
        if judged.verdict != "pass" or better is None:
            continue
        if judged.comparison != better:
            meant = "less" if better == "<=" else "more"
            lines.append(
                f"warning: {judged.requirement} lets the worse of two agents pass, because {meant} {judged.metric} is "
                f"better. Did you mean '{better}'?"
            )
        elif judged.metric == "DS" and 0.0 < judged.limit < 1.0:
            lines.append(
                f"warning: {judged.requirement} is hardly a limit, because DS is 0 to 100. Did you mean "
                f"{100.0 * judged.limit:g}?"
            )
    lines = list(dict.fromkeys(lines))
    hidden = len(lines) - _MOST
    return lines[:_MOST] + ([f"warning: and {hidden} more requirements like these"] if hidden > 0 else [])


def _mixed_machines(run: RunResult) -> list[str]:
    """Return a sentence for each fact of machines (see `runner.episode.machine`) in which the episodes differ."""
    sentences = []
    for name, library in MACHINE_FACTS.items():
        found = Counter(result.versions[name] for result in run.episodes.values() if name in result.versions)
        if len(found) > 1:
            shares = ", ".join(f"{count} on {digest}" for digest, count in found.most_common())
            sentences.append(
                f"these episodes were driven on machines whose {library} gives different bits ({shares}): scores may "
                "differ in their last digits from those of one machine (--drive-fresh drives all of them here)"
            )
    return sentences
