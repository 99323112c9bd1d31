"""What every metric refuses before it computes anything: a number is never made up."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError, UnknownNameError

__all__ = ["MODES", "require_mode", "require_scorable"]

MODES = ("bench2drive", "fixed")
"""`bench2drive` repeats the official tools bug by bug, `fixed` repairs them; each metric says where they differ."""


def require_mode(mode: str) -> None:
    """Raise `UnknownNameError` when `mode` is not one of `MODES`."""
    if mode not in MODES:
        raise UnknownNameError.of("metric mode", mode, MODES)


def require_scorable(results: Sequence[EpisodeResult]) -> None:
    """Raise `ComparisonError` when there is no episode at all or one ended with `infra_error`."""
    if not results:
        raise ComparisonError("there is no episode to score. Expected at least one; a score of nothing is not 0.")
    broken = [result for result in results if result.outcome is Outcome.INFRA_ERROR]
    if broken:
        first = broken[0]
        raise ComparisonError(
            f"{len(broken)} of {len(results)} episodes ended with infra_error and are never scored, "
            f"first: {first.episode}: {first.end_detail}. Drive them again."
        )
