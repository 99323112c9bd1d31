"""Explains why a worker ended without an answer: whose fault the death is, and how its episode ended."""

from __future__ import annotations

import os
import re
import signal
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.engine.shared_state import CUT_OFF, StateReading
from pytest_drive_robust.errors import from_here
from pytest_drive_robust.runner.episode.recorded_ticks import RecordedTicks

_FROM_OUTSIDE = frozenset({signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGQUIT})
_LINE = re.compile(r'^  File "(?P<file>.+)", line (?P<line>\d+) in (?P<name>.+)$', re.MULTILINE)
_LONGEST_LINE = 200


class Cause(Enum):
    """How a request came to an end without an answer."""

    DIED = "the process ended"
    SILENT = "the connection was closed"
    GARBAGE = "the connection carried something else"
    ACT_DEADLINE = "one call took too long"
    EPISODE_DEADLINE = "the episode took too long"


class Blame(Enum):
    """Whose fault the end of a worker process was."""

    AGENT = "agent"
    OURS = "the simulator or we"
    OUTSIDE = "somebody outside, or the kernel"


@dataclass(frozen=True, slots=True)
class Death:
    """The known facts about the end of a worker.

    `status` is the status of `os.waitpid`, None when we killed the worker. `printed` is the last output, with that of
    faulthandler. `lasted_s` is the duration of the phase in `reading`, `elapsed_s` the time since the request,
    `limit_s` the limit that was reached.
    """

    cause: Cause
    reading: StateReading
    status: int | None = None
    limit_s: float = 0.0
    lasted_s: float = 0.0
    elapsed_s: float = 0.0
    printed: str = ""


@dataclass(frozen=True, slots=True)
class Explanation:
    """Whose fault the end of a worker is, how its episode ended, and a sentence for the user.

    `recorded` holds the controls that are known of the episode, None when none are.
    """

    blame: Blame
    end: End
    detail: str
    recorded: RecordedTicks | None = None


def explain(death: Death) -> Explanation:
    """Return whose fault the end of a worker is, with a sentence for the user."""
    phase, tick = death.reading.phase, death.reading.tick
    where = f"in {phase.call} at tick {tick}" if phase.is_agent else f"at tick {tick}"
    place = place_of_fault(death.printed)
    if death.cause in (Cause.ACT_DEADLINE, Cause.EPISODE_DEADLINE):
        return _too_late(death, where, place)
    if death.cause is Cause.SILENT or death.status == CUT_OFF << 8:
        return _agent(f"closed the descriptors of its process {where}")
    if death.cause is Cause.GARBAGE:
        return _agent(f"wrote to the descriptors of its process, noticed {where}")
    assert death.status is not None
    ending, number = _ending(death.status)
    lines = death.printed.partition("Fatal Python error")[0].strip().splitlines()
    last = f"; it last printed {lines[-1][:_LONGEST_LINE]!r}" if lines else ""
    if number in _FROM_OUTSIDE:
        if tick == 0 and not phase.is_agent:
            return _ours(f"killed by {ending} before the episode began")
        perhaps = " (perhaps out of memory)" if number == signal.SIGKILL else ""
        return Explanation(Blame.OUTSIDE, End.AGENT_CRASHED_HARD, f"killed by {ending} {where}{perhaps}{last}")
    if phase.is_agent:
        return _agent(f"{ending} {where}{place}{last}")
    return _ours(f"the simulation ended its process: {ending} {where}{place}{last}")


def place_of_fault(printed: str) -> str:
    """Return `" (agent.py:12 in act)"`, faulthandler's deepest line outside installed libraries; `""` without lines."""
    frames = [(Path(match["file"]), match["line"], match["name"]) for match in _LINE.finditer(printed)]
    outside = [frame for frame in frames if not _is_library(frame[0])] or frames
    if not outside:
        return ""
    path, line, name = outside[0]
    return f" ({from_here(path)}:{line} in {name})"


def _too_late(death: Death, where: str, place: str) -> Explanation:
    phase, reading = death.reading.phase, death.reading
    if death.cause is Cause.ACT_DEADLINE:
        return Explanation(Blame.AGENT, End.AGENT_TIMED_OUT, f"took longer than {death.limit_s:g} s {where}{place}")
    agent_s = reading.agent_s + (death.lasted_s if phase.is_agent else 0.0)
    by_agent = agent_s * 2.0 >= death.elapsed_s
    share = f"the agent used {agent_s:.1f} s of it" if by_agent else "most of it in the simulation"
    detail = f"the episode took longer than {death.limit_s:g} s, {share}; it was {where}{place}"
    return Explanation(Blame.AGENT, End.AGENT_TIMED_OUT, detail) if by_agent else _ours(detail)


def _agent(detail: str) -> Explanation:
    return Explanation(Blame.AGENT, End.AGENT_CRASHED_HARD, detail)


def _ours(detail: str) -> Explanation:
    return Explanation(Blame.OURS, End.SIMULATION_CRASHED, detail)


def _ending(status: int) -> tuple[str, int | None]:
    """Return `("SIGSEGV", 11)`, or `("left the process with exit code 3", None)`."""
    if not os.WIFSIGNALED(status):
        return f"left the process with exit code {os.waitstatus_to_exitcode(status)}", None
    number = os.WTERMSIG(status)
    try:
        return signal.Signals(number).name, number
    except ValueError:
        return f"signal {number}", number


def _is_library(path: Path) -> bool:
    return "site-packages" in path.parts or any(part.startswith("python3") for part in path.parts[:-1])
