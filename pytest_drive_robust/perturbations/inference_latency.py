"""A computer that needs time: its commands come late."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.context import EpisodeContext, Spans
from pytest_drive_robust.perturbations.severity import (
    checked_choice,
    checked_count,
    checked_number,
    checked_numbers,
    delay_ticks,
    refusal,
    whole_ticks,
)


@dataclass
class InferenceLatency(Perturbation):
    """A computer that needs time: the command of an image reaches the vehicle only later.

    ============ =====================================================================================================
    `mode`       with `d = floor(ms / 1000 / dt)` ticks
    ============ =====================================================================================================
    `"fifo"`     `a~_t = a_(t-d)`: the agent runs in every tick, its command is applied `d` ticks later. The paper's
                 equation and the default.
    `"hold"`     the released wrapper: the agent runs once, its command is applied `d` ticks later, and only then the
                 agent runs again; in between the last command is held. So a command is `d` to `2d - 1` ticks old.
    `"measured"` as `"hold"`, with `d = floor(inference_s / dt)` of the wall time of each inference. The times are
                 recorded; passed as `replay_s`, these times replay the episode exactly.
    ============ =====================================================================================================

    Until the first command is due, the vehicle gets the neutral command (throttle 0, steer 0, brake 0). In the first
    `warmup_ticks` ticks of an episode the vehicle always gets the neutral command, while the agent already runs: 20
    ticks in the released code, 0 by default. The clean baseline gets the same warm-up (`Setting.baseline`), so that the
    warm-up is no part of the measured degradation.

    Severity `ms`: milliseconds, 0 (nothing happens) or at least one tick; the paper drives 100, 200 and 500. The mode
    `"measured"` takes no `ms`. `replay_s`: seconds, one value for each inference.

    Source: paper, "Inference Latency" and the appendix on the injection architecture.

    >>> str(InferenceLatency(ms=200)), str(InferenceLatency(ms=200, mode="hold", warmup_ticks=20))
    ('200 ms latency', '200 ms latency (reading=released)')
    >>> str(InferenceLatency(mode="measured"))
    'measured latency'
    """

    ms: float | None = None
    mode: Literal["fifo", "hold", "measured"] = "fifo"
    warmup_ticks: int = 0
    replay_s: tuple[float, ...] = ()

    phrase: ClassVar[str] = "{ms} ms latency"
    variants: ClassVar[Mapping[str, Mapping[str, object]]] = {"measured latency": {"mode": "measured", "ms": None}}
    example: ClassVar[Mapping[str, object]] = {"ms": 200.0}
    ladder: ClassVar = ("ms", "ticks")
    readings: ClassVar[Mapping[str, Mapping[str, object]]] = {
        "paper": {"mode": "fifo", "warmup_ticks": 0},
        "released": {"mode": "hold", "warmup_ticks": 20},
    }

    def __post_init__(self) -> None:
        checked_choice(self, "mode", ("fifo", "hold", "measured"))
        if self.mode != "measured":
            expected = "milliseconds of at least 0 (the paper drives 100, 200 and 500)"
            self.ms = checked_number(self, "ms", expected=expected)
        elif self.ms is not None:
            raise refusal(
                self, "ms", "none with mode='measured', which measures it: for a fixed latency use mode='hold'"
            )
        self.warmup_ticks = checked_count(self, "warmup_ticks", expected="a whole number of ticks of at least 0")
        self.replay_s = checked_numbers(self, "replay_s", expected="a tuple of seconds of at least 0")
        if self.mode != "measured" and self.replay_s:
            raise refusal(self, "replay_s", "none: only mode='measured' takes the times of a recording")
        self._times_s: list[float] = []

    @property
    def measures_inference(self) -> bool:
        """True when the wall clock decides, so that only a replay repeats the episode."""
        return self.mode == "measured" and not self.replay_s

    @property
    def inference_s(self) -> tuple[float, ...]:
        """The time of each inference of this episode in seconds, in the mode `"measured"`: a value for `replay_s`."""
        return tuple(self._times_s)

    def reset(self, context: EpisodeContext) -> None:
        """Empty the buffer. Raises `PerturbationError` for a latency between 0 and one tick."""
        self._dt_s = context.dt_s
        self._ticks = delay_ticks(self, "ms", (self.ms or 0.0) / 1000.0, context.dt_s)
        self._buffer: _Fifo | _Hold = _Fifo(self._ticks) if self.mode == "fifo" else _Hold()
        self._times_s = []
        self._spans = Spans(context.stream)

    def wants_inference(self, tick: int) -> bool:
        """Return True in the mode `"fifo"`; in the other modes, once the last command is due."""
        return self._buffer.is_free(tick)

    def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control:
        """Return the command that is due in `tick`."""
        delay = self._ticks
        if self.mode == "measured" and control is not None and self._buffer.is_free(tick):
            delay = whole_ticks(self._time_s(inference_s), self._dt_s)
        due = self._buffer.exchange(tick, control, delay)
        if self.mode == "measured" or self._ticks or tick < self.warmup_ticks:
            self._spans.touch(tick, ("control",))
        return Control.NEUTRAL if tick < self.warmup_ticks else due

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return how short the latency was, or that all commands were the same."""
        if self.mode == "measured":
            return f"every inference took less than one tick of {1000.0 * dt_s:g} ms"
        ticks = whole_ticks((self.ms or 0.0) / 1000.0, dt_s)
        if ticks == 0:
            return f"latency {self.ms:g} ms is 0 ticks at {1.0 / dt_s:g} Hz"
        return f"the agent never gave another command than {ticks} ticks before"

    def _time_s(self, inference_s: float) -> float:
        if self.replay_s:
            count = len(self._times_s)
            if count == len(self.replay_s):
                raise PerturbationError(
                    f"InferenceLatency: replay_s holds the times of {count} inferences, but the agent ran once more. "
                    "The recording is of another episode: same agent, route, seed and setting replay it."
                )
            inference_s = self.replay_s[count]
        self._times_s.append(inference_s)
        return inference_s


class _Fifo:
    """A queue of `ticks` commands, neutral at first: in every tick one command enters and one command leaves."""

    __slots__ = ("_newest", "_pipe")

    def __init__(self, ticks: int) -> None:
        self._pipe = deque([Control.NEUTRAL] * ticks)
        self._newest = Control.NEUTRAL

    def is_free(self, tick: int) -> bool:
        """Return True: the agent runs in every tick."""
        return True

    def exchange(self, tick: int, control: Control | None, delay: int) -> Control:
        """Add `control` to the queue (the last control again when None) and return the command that is due."""
        if control is not None:
            self._newest = control
        self._pipe.append(self._newest)
        return self._pipe.popleft()


class _Hold:
    """A computer with one request at a time: busy until its command is due. A command holds until the next is due."""

    __slots__ = ("_current", "_due", "_pending")

    def __init__(self) -> None:
        self._current = Control.NEUTRAL
        self._pending: Control | None = None
        self._due = 0

    def is_free(self, tick: int) -> bool:
        """Return True from the tick on in which the last command is due."""
        return tick >= self._due

    def exchange(self, tick: int, control: Control | None, delay: int) -> Control:
        """Release the command that is due, start on the new command, and return the command that holds in this tick.

        A command that comes while the computer is busy is ignored: in a stack, an earlier latency repeats its command
        in every tick.
        """
        if self._pending is not None and tick >= self._due:
            self._current, self._pending = self._pending, None
        if control is not None and tick >= self._due:
            self._due = tick + delay
            if delay == 0:
                self._current = control
            else:
                self._pending = control
        return self._current
