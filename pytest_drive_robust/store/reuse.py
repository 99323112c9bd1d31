"""Which stored episodes stand for another drive of the same."""

from __future__ import annotations

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult


def is_reusable(result: EpisodeResult) -> bool:
    """Tell whether another run would get the same by driving it again: the agent's drive, or its own exception.

    A timeout or a crash of the process may be the machine's doing, an `infra_error` is ours: those are driven again.
    """
    return ends_reusable(result.outcome, result.end)


def ends_reusable(outcome: Outcome, end: End) -> bool:
    """Tell as `is_reusable` does, for an episode of which only its end is known."""
    if outcome is Outcome.AGENT_ERROR:
        return end is End.AGENT_CRASHED
    return outcome in (Outcome.COMPLETED, Outcome.FAILED)
