"""Decides which stored episodes other runs may reuse."""

from __future__ import annotations

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult

NO_MEMORY = ("MemoryError", "Cannot allocate memory", "Insufficient memory")
"""Phrases for missing memory, from Python, the operating system (repeated by torch) and OpenCV."""
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
"""Phrases for any missing resource: GPU memory (CUDA, JAX, cuBLAS, cuDNN), and disk space, open files, threads and
processes (the operating system, Python).
"""


def is_reusable(result: EpisodeResult) -> bool:
    """Return whether driving the episode again would give the same result: a whole drive, or an agent's own exception.

    False after a timeout or a crash of the process, which the machine may have caused, after an `infra_error`, and
    after an exception for lack of a resource: memory, GPU memory, disk space, open files, threads.
    """
    return ends_reusable(result.outcome, result.end) and not ran_out(result)


def ran_out(result: EpisodeResult) -> bool:
    """Return whether the agent raised for lack of a resource, of which another run may have more (see `RAN_OUT`)."""
    return result.end is End.AGENT_CRASHED and any(words in result.end_detail for words in RAN_OUT)


def ends_reusable(outcome: Outcome, end: End) -> bool:
    """Return whether an episode with this outcome and end is reusable, without looking for a lack of resources."""
    if outcome is Outcome.AGENT_ERROR:
        return end is End.AGENT_CRASHED
    return outcome in (Outcome.COMPLETED, Outcome.FAILED)
