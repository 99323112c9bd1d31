"""What the official status strings mean (Bench2Drive `leaderboard/utils/statistics_manager.py`)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from pytest_drive_robust.domain.outcome import End, Outcome

__all__ = ["STATUSES", "SUCCESSES", "is_harness_error"]

SUCCESSES = ("Completed", "Perfect")
"""`Perfect` is `Completed` with no message at all, not even one about speed."""

STATUSES: Mapping[str, tuple[Outcome, End]] = MappingProxyType(
    {
        "Completed": (Outcome.COMPLETED, End.COMPLETED),
        "Perfect": (Outcome.COMPLETED, End.COMPLETED),
        "Failed - Agent deviated from the route": (Outcome.FAILED, End.DEVIATED),
        "Failed - Agent got blocked": (Outcome.FAILED, End.BLOCKED),
        "Failed - Agent timed out": (Outcome.FAILED, End.TICK_CAP),
        "Failed - TickRuntime": (Outcome.FAILED, End.TICK_CAP),
        "Failed - Agent crashed": (Outcome.AGENT_ERROR, End.AGENT_CRASHED),
        "Failed - Agent couldn't be set up": (Outcome.AGENT_ERROR, End.AGENT_CRASHED),
        "Failed - Agent's sensors were invalid": (Outcome.AGENT_ERROR, End.AGENT_CRASHED),
        "Failed - Simulation crashed": (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED),
        # Ended without a reason, or never ended: the evaluator was interrupted.
        "Failed": (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED),
        "Started": (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED),
        # Two that only our own exports have.
        End.STUCK.value: (Outcome.FAILED, End.STUCK),
        End.ENVIRONMENT.value: (Outcome.FAILED, End.ENVIRONMENT),
    }
)
"""Every status that is understood, with whose doing it is."""


def is_harness_error(status: str) -> bool:
    """Return True for what says nothing about the agent: never a score, except in the official totals."""
    return STATUSES[status][0] is Outcome.INFRA_ERROR
