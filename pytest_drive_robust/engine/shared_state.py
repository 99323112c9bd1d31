"""Memory that we share with a worker: whose code runs, since when, and every control so far.

The worker writes and we read. The memory survives the worker, so that we can say whose fault the worker's end is and
score the episode up to that tick.
"""

from __future__ import annotations

import json
import math
import mmap
import os
import struct
import tempfile
import time
import traceback
from contextlib import suppress
from dataclasses import asdict
from enum import IntEnum
from typing import NamedTuple

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.engine.worker.system import descriptor_identity
from pytest_drive_robust.runner.episode.recorded_ticks import RecordedTicks
from pytest_drive_robust.runner.episode.watch import Watch

CUT_OFF = 71
"""The exit code of a worker that can no longer answer because its agent closed the connection."""
_READING = struct.Struct("<IIdd")  # phase, tick, start of the phase in s, the agent's seconds before that phase
_COUNT = struct.Struct("<I")
_COUNT_AT = 32
_RIG_AT = 64
_RIG_BYTES = 1 << 15
_ROWS_AT = _RIG_AT + _RIG_BYTES
_ROW = struct.Struct("<6d")  # throttle, steer, brake as the agent asked for them (NaN: not asked), and as applied
_UNASKED = (math.nan,) * 3
_MOST_TICKS = 1 << 20


class Phase(IntEnum):
    """Whose code runs: the agent's in `MAKE`, `RESET` and `ACT`, ours or the simulator's in `SIM` and `IDLE`."""

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
        """True for a call with a time limit. Making an agent has none: loading weights may take long."""
        return self is Phase.RESET or self is Phase.ACT

    @property
    def call(self) -> str:
        """The name of the agent's call for a message: `"its constructor"`, `"reset"`, `"act"`."""
        return "its constructor" if self is Phase.MAKE else self.name.lower()


class StateReading(NamedTuple):
    """One reading of the shared state: `since_s` is monotonic time, `agent_s` excludes the current phase."""

    phase: Phase
    tick: int
    since_s: float
    agent_s: float


class SharedState(Watch):
    """The shared memory behind the file descriptor `fd`, which may be closed afterwards.

    `connection` is the descriptor by which the worker answers; when the agent closes it, the worker exits in that tick.
    """

    def __init__(self, fd: int, *, connection: int | None = None) -> None:
        size = os.fstat(fd).st_size
        self._memory = mmap.mmap(fd, size)
        self._capacity = (size - _ROWS_AT) // _ROW.size
        self._phase = Phase.IDLE
        self._since_s = 0.0
        self._agent_s = 0.0
        self._connection = connection
        self._identity = None if connection is None else descriptor_identity(connection)

    def clear(self) -> None:
        """Clear the state for a new episode: no tick, no cameras."""
        self._agent_s = 0.0
        self._write(_COUNT_AT, _COUNT.pack(0))
        self._write(_RIG_AT, _COUNT.pack(0))
        self.phase("idle", 0)

    def phase(self, name: str, tick: int) -> None:
        """Note that the phase `name` runs from now on. Exit with `CUT_OFF` when the agent closed the connection."""
        now = time.monotonic()
        if self._phase.is_agent:
            self._agent_s += now - self._since_s
            if self._connection is not None and descriptor_identity(self._connection) != self._identity:
                os._exit(CUT_OFF)
        self._phase, self._since_s = Phase[name.upper()], now
        self._write(0, _READING.pack(self._phase, tick, now, self._agent_s))

    def equip(self, cameras: tuple[CameraSpec, ...], consumes: tuple[str, ...], *, privileged: bool) -> None:
        """Keep the agent's cameras and signals, unless they are too long: then the episode cannot be scored later."""
        text = json.dumps([[asdict(camera) for camera in cameras], consumes, privileged]).encode()
        if len(text) <= _RIG_BYTES - _COUNT.size:
            self._write(_RIG_AT + _COUNT.size, text)
            self._write(_RIG_AT, _COUNT.pack(len(text)))

    def ticked(
        self, tick: int, state: WorldState, observation: Observation, asked: Control | None, applied: Control
    ) -> None:
        """Keep the controls of a driven tick. Episodes in a batch overwrite each other's rows; nobody reads those."""
        if tick < self._capacity:
            answer = _UNASKED if asked is None else (asked.throttle, asked.steer, asked.brake)
            row = (*answer, applied.throttle, applied.steer, applied.brake)
            self._write(_ROWS_AT + tick * _ROW.size, _ROW.pack(*row))
            self._write(_COUNT_AT, _COUNT.pack(tick + 1))

    def failed(self, error: Exception) -> None:
        """Print the whole traceback to the agent's output: a result holds only one line of the traceback."""
        if error.__cause__ is not None:
            with suppress(Exception):  # the agent may have closed the output
                traceback.print_exception(error.__cause__)

    def _write(self, start: int, data: bytes) -> None:
        """Write `data` in one piece.

        `pack_into` clears the bytes first: a reader in between would see a call that began at 0 s and call it late.
        """
        self._memory[start : start + len(data)] = data

    @property
    def ticks(self) -> int:
        """The number of driven ticks, at most the number of rows in the memory."""
        return int(min(_COUNT.unpack_from(self._memory, _COUNT_AT)[0], self._capacity))

    def read(self) -> StateReading:
        """Return the current phase, read twice until both readings agree, so that no half-written one is returned."""
        while True:
            first, second = (_READING.unpack_from(self._memory, 0) for _ in range(2))
            if first == second:
                break
        phase, tick, since_s, agent_s = first
        return StateReading(Phase(min(phase, Phase.IDLE)), tick, since_s, agent_s)  # the memory may be overwritten

    def recorded(self) -> RecordedTicks | None:
        """Return the recorded controls of the episode; None before its start, or when the worker wrote nonsense."""
        length = _COUNT.unpack_from(self._memory, _RIG_AT)[0]
        start = _RIG_AT + _COUNT.size
        try:
            cameras, consumes, privileged = json.loads(self._memory[start : start + length])
            rig: tuple[CameraSpec, ...] = tuple(CameraSpec(**camera) for camera in cameras)
        except (ValueError, TypeError):
            return None
        rows = list(_ROW.iter_unpack(self._memory[_ROWS_AT : _ROWS_AT + self.ticks * _ROW.size]))
        asked = tuple(None if math.isnan(row[0]) else Control(*row[:3]) for row in rows)
        return RecordedTicks(rig, tuple(consumes), bool(privileged), asked, tuple(Control(*row[3:]) for row in rows))


def shared_file(tick_cap: int) -> int:
    """Return a descriptor of zeroed memory (or of a deleted file), large enough for an episode of `tick_cap` ticks.

    Memory that is not written to costs nothing.
    """
    if hasattr(os, "memfd_create"):
        fd = os.memfd_create("drive-robust-state")
    else:
        fd, path = tempfile.mkstemp(prefix="drive-robust-state-")
        os.unlink(path)
    os.ftruncate(fd, _ROWS_AT + min(tick_cap + 1, _MOST_TICKS) * _ROW.size)
    return fd
