"""What an episode may use of the machine."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Limits"]


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of every episode; None where there is none.

    `episode_s` is the wall time of an episode, `act_s` that of one call of the agent (`sensors`, `reset`, `act`).
    `memory_bytes` is what its process may allocate (`RLIMIT_DATA`, Linux only). Of what the process prints, the last
    `output_bytes` are kept. A process that grew by `growth_bytes` since its first episode is replaced.
    """

    episode_s: float | None = None
    act_s: float | None = None
    memory_bytes: int | None = None
    output_bytes: int = 65536
    growth_bytes: int = 256 << 20
