"""Episodes of one run that were driven on machines that compute differently."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.result import MACHINE_FACTS

if TYPE_CHECKING:
    from pytest_drive_robust.report.run_result import RunResult

__all__ = ["mixed_machines"]


def mixed_machines(run: RunResult) -> list[str]:
    """Return a sentence for each digest (see `runner.episode.machine`) of which the episodes have several."""
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
