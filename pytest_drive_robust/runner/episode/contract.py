"""Checks the agent's contract at every call: every fault of an agent becomes an `AgentError` with one sentence."""

from __future__ import annotations

import traceback
from bdb import BdbQuit
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import AsyncGeneratorType, CoroutineType, FrameType, GeneratorType

from pytest_drive_robust.domain.agent import SIGNALS, Agent, PlannedPath, is_privileged
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.errors import AgentError, did_you_mean

BLAMED: tuple[type[BaseException], ...] = (Exception, SystemExit)
"""Exceptions that count as the agent's fault. KeyboardInterrupt comes from the user, and pytest's timeout from pytest:
both derive only from BaseException and go through. Neither reaches a worker process, which blames the agent for all."""

_MOST_CHARACTERS = 20_000
"""Longest text of an exception or value in a message: it may hold megabytes."""
_MOST_DEEP = 20
"""Deepest nesting of exception groups that is shown: an object that resembles a group may hold itself."""
_LATER = (CoroutineType, GeneratorType, AsyncGeneratorType)
"""What a function with `async` or `yield` returns before a line of it has run."""
_CALLERS = (
    "pytest_drive_robust.engine.",
    "pytest_drive_robust.bench2drive.agents.",
    "pytest_drive_robust.domain.agent",
    "pytest_drive_robust.runner.",
    "pytest_drive_robust.testing.",
    "pytest_drive_robust.perturbations.base",
    "pytest_drive_robust.perturbations.stack",
)
"""Modules that only pass calls on to agents, simulators and perturbations; an error is never theirs."""


def agent_cameras(agent: Agent, dt_s: float) -> tuple[CameraSpec, ...]:
    """Return the agent's rig, checked.

    Names are distinct, sizes 1..4096 px, fields of view 1..179 degrees, rates divide `1 / dt_s`. Raises `AgentError`.
    """
    with _blamed("sensors"):
        cameras: object = agent.sensors()
    if not isinstance(cameras, Sequence) or isinstance(cameras, str):
        raise AgentError(f"sensors returned {_shown(cameras)}, expected a list of CameraSpec")
    for camera in cameras:
        if not isinstance(camera, CameraSpec):
            raise AgentError(
                f"sensors returned {_shown(camera)}: it is a {type(camera).__name__}, expected a CameraSpec"
            )
        problem = camera.problem(dt_s)
        if problem is not None:
            raise AgentError(f"sensors returned {_shown(camera)}: {problem}")
    names = [camera.name for camera in cameras]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise AgentError(f"sensors returned two cameras named {twice[0]!r}, expected distinct names")
    return tuple(cameras)


def agent_consumes(agent: Agent) -> tuple[str, ...]:
    """Return the signals that the agent declares to use, sorted. Raises `AgentError`."""
    with _blamed("consumes"):
        given = getattr(agent, "consumes", SIGNALS)
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise AgentError(f"consumes is {_shown(given)}, expected a set of names out of {', '.join(sorted(SIGNALS))}")
    with _blamed("consumes"):
        named = list(given)
    for name in named:
        if name not in SIGNALS:
            hint = did_you_mean(str(name), SIGNALS)
            raise AgentError(
                f"consumes has {_shown(name)}, which is no signal.{hint} There are {', '.join(sorted(SIGNALS))}"
            )
    return tuple(sorted(named))


def agent_privileged(agent: Agent) -> bool:
    """Return whether the agent asks for ground truth. Raises `AgentError`."""
    with _blamed("privileged"):
        return is_privileged(agent)


def agent_reset(agent: Agent, plan: GlobalPlan, seed: int) -> None:
    """Call the agent's `reset` at the start of an episode. Raises `AgentError`, also for a `reset` that never ran."""
    with _blamed("reset"):
        returned: object = agent.reset(plan, seed)  # type: ignore[func-returns-value]
    if isinstance(returned, _LATER):
        if isinstance(returned, CoroutineType):
            returned.close()  # else Python warns that nobody awaited it
        raise AgentError("reset is a coroutine or generator, so nothing of it ran: write it without async and yield")


def agent_plan(agent: Agent) -> PlannedPath:
    """Return the agent's plan. Raises `AgentError`, also for an agent without `plan`."""
    with _blamed("plan"):
        return agent.plan()  # type: ignore[attr-defined, no-any-return]


def agent_act(agent: Agent, observation: Observation) -> Control:
    """Return one control in plain floats, within its ranges. Raises `AgentError`."""
    try:  # spelled out, not `_blamed`: this is called in every tick
        control: object = agent.act(observation)
    except BLAMED as error:
        if _quits(error):
            raise KeyboardInterrupt("the debugger was left") from error
        raise AgentError(blame("act", error)) from error
    return _checked(control, "act")


def agent_act_batch(agents: Sequence[Agent], observations: Sequence[Observation]) -> list[Control | AgentError]:
    """Return one answer for each agent: its control in plain floats, or an `AgentError` that says what is wrong.

    Raises `AgentError` when no single agent can be blamed: there is no `act_batch`, or it raised, or it returned no
    list with one answer for each agent.
    """
    act_batch = getattr(agents[0], "act_batch", None)
    if not callable(act_batch):
        raise AgentError(f"{type(agents[0]).__name__} has no act_batch")
    with _blamed("act_batch"):
        answers: object = act_batch(agents, observations)
    if not isinstance(answers, Sequence) or len(answers) != len(agents):
        given = f"{len(answers)} answers" if isinstance(answers, Sequence) else _shown(answers)
        raise AgentError(f"act_batch returned {given} for {len(agents)} agents, expected one Control for each")
    return [_judged(answer) for answer in answers]


def _judged(answer: object) -> Control | AgentError:
    if isinstance(answer, Exception):
        return AgentError(blame("act_batch", answer, "returned"))
    try:
        return _checked(answer, "act_batch")
    except AgentError as error:
        return error


def _checked(control: object, call: str) -> Control:
    if not isinstance(control, Control):
        raise AgentError(f"{call} returned {_shown(control)} of type {type(control).__name__}, expected a Control")
    problem = control.problem()
    if problem is not None:
        raise AgentError(f"{call} returned {_shown(control)}: {problem}")
    if type(control.throttle) is type(control.steer) is type(control.brake) is float:
        return control
    return Control(float(control.throttle), float(control.steer), float(control.brake))


def blame(call: str, error: BaseException, verb: str = "raised") -> str:
    """Return a sentence such as `"act raised ZeroDivisionError: division by zero (my_agent.py:12 in act)"`."""
    return f"{call} {verb} {_cut(_in_words(error))}{_place(error)}"


class _AloneError(Exception):
    """Stands for a group of exceptions, without what it holds and without its context."""

    def __str__(self) -> str:
        return str(self.args[0])


def _in_words(error: BaseException, depth: int = 0) -> str:
    """Return the last line of an error's traceback, then its notes, then the errors that a group holds."""
    # alone: for a group `TracebackException` also describes all that it holds, and each of those again as the context
    # of the next, which is quadratic in the depth
    alone = error if not hasattr(error, "exceptions") else _AloneError(error)
    told = traceback.TracebackException(type(error), alone, None, limit=0, compact=True)
    told.__notes__ = None  # type: ignore[attr-defined]  # notes would be the last lines
    noted = getattr(error, "__notes__", ())
    notes = noted if isinstance(noted, (list, tuple)) else (noted,)
    words = [[*told.format_exception_only()][-1].strip()]
    words += [note if isinstance(note, str) else _shown(note) for note in notes]
    held = getattr(error, "exceptions", ())
    if depth < _MOST_DEEP and isinstance(held, tuple) and all(isinstance(one, BaseException) for one in held):
        words += [_in_words(one, depth + 1) for one in held]
    return "; ".join(words)


def _shown(value: object) -> str:
    """Return a value of an agent as text, also when its `__repr__` raises."""
    try:
        return _cut(repr(value))
    except BLAMED as error:
        return f"something that cannot be shown ({type(error).__name__} in its __repr__)"


def _cut(text: str) -> str:
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]}..."


@contextmanager
def _blamed(call: str) -> Iterator[None]:
    try:
        yield
    except BLAMED as error:
        if _quits(error):
            raise KeyboardInterrupt("the debugger was left") from error
        raise AgentError(blame(call, error)) from error


def _quits(error: BaseException) -> bool:
    """Return whether the user quit a debugger in this process; pytest replaces `BdbQuit` by its own exception."""
    return BaseException not in BLAMED and (isinstance(error, BdbQuit) or type(error).__module__ == "_pytest.outcomes")


def _place(error: BaseException) -> str:
    """Return `" (my_agent.py:12 in act)"`, the deepest line in the package that was called first, where to look."""
    frames = [found for found in traceback.walk_tb(error.__traceback__) if not _module(found[0]).startswith(_CALLERS)]
    packages = [_module(frame).partition(".")[0] for frame, _ in frames]
    if not frames:
        return ""
    frame, line = [found for found, package in zip(frames, packages, strict=True) if package == packages[0]][-1]
    shown = Path(frame.f_code.co_filename)
    with suppress(ValueError, OSError):  # the file lies elsewhere, or the current folder is gone
        shown = shown.relative_to(Path.cwd())
    return f" ({shown}:{line} in {frame.f_code.co_name})"


def _module(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", ""))
