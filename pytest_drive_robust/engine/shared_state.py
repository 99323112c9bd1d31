"""Memory that we share with a worker: whose code runs, since when, and every control so far.

The worker writes, we read. What stands there survives the worker, so we can say whose fault its death is and have the
episode scored up to that tick.
"""

from __future__ import annotations

import json
import mmap
import os
import struct
import tempfile
import time
from dataclasses import asdict
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.runner.episode.rescore import ROW_FIELDS
from pytest_drive_robust.runner.episode.stored_controls import AgentRig

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.domain.truth import WorldState

__all__ = ["Phase", "SharedState", "StateReading", "shared_file", "state_bytes"]

_READING = struct.Struct("<IIdd")  # phase, tick, when the phase began, seconds of the agent before it
_COUNT = struct.Struct("<I")
_COUNT_AT = 32
_RIG_AT = 64
_RIG_BYTES = 1 << 15
_ROWS_AT = _RIG_AT + _RIG_BYTES
_ROW = struct.Struct(f"<{ROW_FIELDS}d")
_MOST_TICKS = 1 << 20


class Phase(IntEnum):
    """Whose code runs. In the first three it is the agent's."""

    MAKE = 0
    RESET = 1
    ACT = 2
    SIM = 3
    IDLE = 4

    @property
    def is_agent(self) -> bool:
        """True while the agent's code runs."""
        return self <= Phase.ACT

    @property
    def is_call(self) -> bool:
        """True for the calls that must return in time. Making an agent may take as long as its weights do."""
        return self is Phase.RESET or self is Phase.ACT

    @property
    def call(self) -> str:
        """What the agent was asked for, in the words of a message."""
        return "its constructor" if self is Phase.MAKE else self.name.lower()


class StateReading(NamedTuple):
    """What the shared state says: `since_s` by the monotonic clock, `agent_s` with the current phase left out."""

    phase: Phase
    tick: int
    since_s: float
    agent_s: float


class SharedState:
    """The memory behind a file descriptor, which may be closed afterwards.

    `asked` is what the agent answered in this tick, on the worker's side.
    """

    def __init__(self, fd: int) -> None:
        size = os.fstat(fd).st_size
        self._memory = mmap.mmap(fd, size)
        self._capacity = (size - _ROWS_AT) // _ROW.size
        self._phase = Phase.IDLE
        self._since_s = 0.0
        self._agent_s = 0.0
        self.asked: object = None

    def clear(self) -> None:
        """Begin a new episode: nothing was driven yet."""
        self._agent_s = 0.0
        self.asked = None
        _COUNT.pack_into(self._memory, _COUNT_AT, 0)
        _COUNT.pack_into(self._memory, _RIG_AT, 0)
        self.phase("idle", 0)

    def phase(self, name: str, tick: int) -> None:
        """Note that the code of the phase of that name runs from now on: see `runner.episode.loop.Watch`."""
        now = time.monotonic()
        if self._phase.is_agent:
            self._agent_s += now - self._since_s
        self._phase, self._since_s = Phase[name.upper()], now
        _READING.pack_into(self._memory, 0, self._phase, tick, now, self._agent_s)

    def equip(self, rig: AgentRig) -> None:
        """Keep the agent's rig, unless it is too large: then the episode cannot be driven again without the agent."""
        text = json.dumps(asdict(rig)).encode()
        if len(text) <= _RIG_BYTES - _COUNT.size:
            start = _RIG_AT + _COUNT.size
            self._memory[start : start + len(text)] = text
            _COUNT.pack_into(self._memory, _RIG_AT, len(text))

    def ticked(self, tick: int, world: WorldState, observation: Observation, applied: Control) -> None:
        """Keep a tick that was driven (see `on_tick` of `runner.episode.loop.drive_episode`).

        That is what the agent asked for, what the vehicle got, where it stood before. Of episodes that are driven
        together a mixture is kept, which nobody reads.
        """
        asked, self.asked = self.asked, None
        if tick >= self._capacity:
            return
        raw = _UNASKED
        if isinstance(asked, Control) and asked.problem() is None:  # numbers, but perhaps not floats yet
            raw = float(asked.throttle), float(asked.steer), float(asked.brake)
        ego = world.ego
        row = (*raw, applied.throttle, applied.steer, applied.brake, ego.x_m, ego.y_m, ego.speed_mps)
        _ROW.pack_into(self._memory, _ROWS_AT + tick * _ROW.size, *row)
        _COUNT.pack_into(self._memory, _COUNT_AT, tick + 1)

    @property
    def ticks(self) -> int:
        """Ticks that were driven, as far as there is room."""
        return int(min(_COUNT.unpack_from(self._memory, _COUNT_AT)[0], self._capacity))

    def read(self) -> StateReading:
        """Return what happens now, never half of what was just written."""
        while True:
            first, second = (_READING.unpack_from(self._memory, 0) for _ in range(2))
            if first == second:
                break
        phase, tick, since_s, agent_s = first
        return StateReading(Phase(phase) if phase in _PHASES else Phase.IDLE, tick, since_s, agent_s)

    def rig(self) -> AgentRig | None:
        """Return the agent's rig, None before it was known. Raises `ValueError` where the worker wrote nonsense."""
        length = _COUNT.unpack_from(self._memory, _RIG_AT)[0]
        if not length:
            return None
        start = _RIG_AT + _COUNT.size
        fields: dict[str, Any] = json.loads(self._memory[start : start + length])
        cameras = tuple(CameraSpec(**item) for item in fields["cameras"])
        return AgentRig(cameras, tuple(fields["consumes"]), bool(fields["privileged"]))

    def rows(self) -> NDArray[np.float64]:
        """Return an array of shape (ticks, 9): see `runner.episode.rescore`."""
        import numpy as np

        data = self._memory[_ROWS_AT : _ROWS_AT + self.ticks * _ROW.size]
        return np.frombuffer(data, np.float64).reshape(-1, ROW_FIELDS)


_UNASKED = (float("nan"),) * 3
_PHASES = frozenset(map(int, Phase))


def state_bytes(tick_cap: int) -> int:
    """Return the size of the state of episodes of so many ticks. Memory that is not written to costs nothing."""
    return _ROWS_AT + min(tick_cap + 1, _MOST_TICKS) * _ROW.size


def shared_file(name: str, size: int) -> int:
    """Return a descriptor of `size` zero bytes in memory (or in a deleted file), not inherited unless asked for."""
    if hasattr(os, "memfd_create"):
        fd = os.memfd_create(f"drive-robust-{name}")
    else:
        fd, path = tempfile.mkstemp(prefix=f"drive-robust-{name}-")
        os.unlink(path)
    os.ftruncate(fd, size)
    return fd
