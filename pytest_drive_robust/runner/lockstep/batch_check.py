"""Checks that an agent's `act_batch` gives the same bits in any company, with its own network on this machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.agent import offers_lockstep
from pytest_drive_robust.errors import AgentError, UsageError
from pytest_drive_robust.runner.episode.contract import agent_act_batch, agent_reset
from pytest_drive_robust.runner.episode.loop import RunningEpisode, tell_phase
from pytest_drive_robust.runner.lockstep.batch import ROWS, WIDTH, own_copy

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.domain.route import GlobalPlan
    from pytest_drive_robust.runner.episode.loop import Watch
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["Recording", "admit", "check_lockstep", "record"]

_ADVICE = (
    "Usual causes: batch normalisation or dropout in training mode, attention or statistics across rows, state that "
    "agents share, more than one thread, a layer of few outputs whose number of inputs is no multiple of four (pad it: "
    "the bits of such a product depend on where in memory a row begins), and a processor on which a product's rows "
    "depend on each other in the last bits (evaluate the network row by row in act_batch)."
)


@dataclass(frozen=True, slots=True)
class Recording:
    """What one agent was given: the arguments of its `reset`, then observations."""

    plan: GlobalPlan
    seed: int
    observations: tuple[Observation, ...]

    @property
    def backwards(self) -> Recording:
        """Return the same observations in the other order: another episode for whoever remembers the last one."""
        return Recording(self.plan, self.seed, self.observations[::-1])


def admit(
    world: Simulator, make_agent: Callable[[], Agent], request: EpisodeRequest, *, width: int, watch: Watch | None
) -> bool:
    """Drive the beginning of `request` by `act`, then ask `act_batch` about it in batches of several widths.

    False when nothing was seen to ask about. Raises `UsageError` for an agent that must not be driven in lockstep.
    """
    recording = record(world, make_agent(), request, watch=watch)
    if recording is None:
        return False
    problem = check_lockstep(make_agent, [recording], sorted({ROWS, WIDTH, 2 * WIDTH, width}), watch=watch)
    if problem is None:
        return True
    raise UsageError(
        f"the agent {request.episode.agent!r} cannot be driven in lockstep: {problem} Leave out --drive-lockstep "
        "(drive_lockstep) and its episodes are driven one by one."
    )


def record(
    world: Simulator,
    agent: Agent,
    request: EpisodeRequest,
    *,
    count: int = 8,
    every: int = 8,
    watch: Watch | None = None,
) -> Recording | None:
    """Drive the beginning of `request` by the agent's own `act` and keep every so many-th observation, up to `count`.

    None when the world, the agent or a perturbation broke before anything was seen. `watch` is told whose code runs.
    """
    running = RunningEpisode(world, agent, request.route, request.setting, request.episode.seed, watch=watch)
    running.attempt(running.start)
    kept: list[Observation] = []

    def tick() -> None:
        given = running.sense()
        if given is None:
            running.advance(None, 0.0)
            return
        if running.recorder.ticks >= every * len(kept):
            kept.append(own_copy(given))
        running.advance(running.ask(given)[0], 0.0)

    while len(kept) < count and not running.over:
        running.attempt(tick)
    return Recording(running.plan, running.seed, tuple(kept)) if kept and running.plan is not None else None


def check_lockstep(
    make_agent: Callable[[], Agent],
    recordings: Sequence[Recording],
    widths: Sequence[int] = (4, 8, 16),
    *,
    watch: Watch | None = None,
) -> str | None:
    """Return in one sentence why the agent must not be driven in lockstep, or None when nothing speaks against it.

    The same observations are given in batches of all `widths`, at other places and among other neighbours; every
    control must agree to the last bit. `watch` is told whose code runs.

    Raises `ValueError` without recordings and for widths that are no multiples of four.
    """
    if not recordings or any(width < ROWS or width % ROWS for width in widths):
        raise ValueError(f"expected recordings and widths that are multiples of {ROWS}, got widths {tuple(widths)}")
    streams = [stream for recording in recordings for stream in (recording, recording.backwards)]
    agents = [make_agent() for _ in range(max(widths))]
    if not offers_lockstep(agents[0]):
        return f"{type(agents[0]).__name__} has no act_batch."
    first: dict[tuple[int, int], tuple[Control, str]] = {}
    try:
        for width in widths:
            for seating in _seatings(width, len(streams)):
                for place, stream, moment, control in _answers(agents[:width], seating, streams, watch):
                    where = f"at place {place} of {width}"
                    known, there = first.setdefault((stream, moment), (control, where))
                    if repr(known) != repr(control):  # repr tells floats apart to the bit, and -0.0 from 0.0
                        told = f"act_batch gives {known} {there} and {control} {where}"
                        return f"{told} for the same observation in other company. {_ADVICE}"
    except AgentError as error:
        return f"{error}."
    return None


def _seatings(width: int, streams: int) -> Iterator[list[int]]:
    """Yield who has which place: all mixed; one alone among equals, last; the same one, second, among others."""
    yield list(islice(cycle(range(streams)), width))
    yield [1] * (width - 1) + [0]
    yield [streams - 1, 0] + [streams // 2] * (width - 2)


def _answers(
    agents: Sequence[Agent], seating: Sequence[int], streams: Sequence[Recording], watch: Watch | None
) -> Iterator[tuple[int, int, int, Control]]:
    """Yield (place, stream, moment, control) of every row. Raises `AgentError`."""
    rows = [streams[stream] for stream in seating]
    for agent, row in zip(agents, rows, strict=True):
        tell_phase(watch, "reset", 0)
        agent_reset(agent, row.plan, row.seed)
    for moment in range(min(len(row.observations) for row in streams)):
        given = tuple(own_copy(row.observations[moment]) for row in rows)
        tell_phase(watch, "act", moment)
        answers = agent_act_batch(agents, given)
        tell_phase(watch, "sim", moment)
        for place, answer in enumerate(answers):
            if isinstance(answer, AgentError):
                raise answer
            yield place, seating[place], moment, answer
