"""Which stored episodes stand for another drive of the same."""

from __future__ import annotations

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult

NO_MEMORY = ("MemoryError", "Cannot allocate memory", "Insufficient memory")
"""In the words of Python, the system (torch repeats them) and OpenCV."""
RAN_OUT = (
    *NO_MEMORY,
    "out of memory",
    "Out of memory",
    "STATUS_ALLOC_FAILED",
    "No space left on device",
    "Disk quota exceeded",
    "Too many open files",
    "can't start new thread",
    "Resource temporarily unavailable",
)
"""Of a GPU in the words of CUDA, JAX, cuBLAS and cuDNN; of a disk, files, threads and processes in those of the system
and of Python."""


def is_reusable(result: EpisodeResult) -> bool:
    """Tell whether another run would get the same by driving it again: the agent's drive, or its own exception.

    A timeout or a crash of the process may be the machine's doing, an `infra_error` is ours: those are driven again. So
    is what the agent raised because the machine had no more: memory, that of a GPU, room on a disk, files,
    threads.
    """
    return ends_reusable(result.outcome, result.end) and not ran_out(result)


def ran_out(result: EpisodeResult) -> bool:
    """Tell whether the agent raised for lack of what another run may have more of."""
    return result.end is End.AGENT_CRASHED and any(words in result.end_detail for words in RAN_OUT)


def ends_reusable(outcome: Outcome, end: End) -> bool:
    """Tell as `is_reusable` does, for an episode of which only its end is known."""
    if outcome is Outcome.AGENT_ERROR:
        return end is End.AGENT_CRASHED
    return outcome in (Outcome.COMPLETED, Outcome.FAILED)
