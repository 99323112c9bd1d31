"""The lockstep check of an agent: does its `act_batch` give the same bits in any batch?

The check asks the agent's own network on this machine, with observations that the agent's `act` met before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice

from pytest_drive_robust.domain.agent import Agent, offers_lockstep
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.errors import AgentError, UsageError
from pytest_drive_robust.runner.episode.contract import agent_act_batch, agent_reset
from pytest_drive_robust.runner.episode.loop import RunningEpisode
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.runner.lockstep.batch import ROWS, WIDTH, sizes
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import Simulator

_ADVICE = (
    "Usual causes: batch normalisation or dropout in training mode, attention or statistics across rows, state that "
    "agents share, more than one thread, a layer of few outputs whose number of inputs is no multiple of four (pad it: "
    "the bits of such a product depend on where in memory a row begins), and a processor on which a product's rows "
    "depend on each other in the last bits (evaluate the network row by row in act_batch)."
)


@dataclass(frozen=True, slots=True)
class Recording:
    """The inputs of one agent: the arguments of its `reset`, then observations."""

    plan: GlobalPlan
    seed: int
    observations: tuple[Observation, ...]


def admit(
    world: Simulator, make_agent: Callable[[], Agent], request: EpisodeRequest, *, width: int, watch: Watch | None
) -> bool:
    """Check an agent for lockstep: record the beginning of `request`, then ask `act_batch` in several widths.

    Returns False when there was no observation to check with. Raises `UsageError` for an agent that must not be driven
    in lockstep.
    """
    recording = record(world, make_agent(), request, watch=watch)
    if recording is None:
        return False
    problem = check_lockstep(make_agent, [recording], sorted({*sizes(2 * WIDTH), *sizes(width)}), watch=watch)
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
    """Drive the beginning of `request` by the agent's `act`; keep one observation in `every` ticks, up to `count`.

    Returns None when the world, the agent or a perturbation broke before the first observation. `watch` is told whose
    code runs.
    """
    running = RunningEpisode(world, agent, request.route, request.setting, request.episode.seed, watch=watch)
    running.attempt(running.start)
    kept: list[Observation] = []

    def tick() -> None:
        given = running.sense()
        if given is not None:
            if running.ticks >= every * len(kept):
                kept.append(given.private())
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
    """Return one sentence why the agent must not be driven in lockstep, or None when it may.

    The same observations are given in batches of all `widths`, in different rows and with different neighbours; every
    control must agree to the last bit. `watch` is told whose code runs. Raises `ValueError` without recordings, and for
    widths that are no multiples of four.
    """
    if not recordings or any(width < ROWS or width % ROWS for width in widths):
        raise ValueError(f"expected recordings and widths that are multiples of {ROWS}, got widths {tuple(widths)}")
    # The reversed order is another episode for an agent that remembers the last observation.
    streams = [replace(one, observations=one.observations[::step]) for one in recordings for step in (1, -1)]
    agents = [make_agent() for _ in range(max(widths))]
    if not offers_lockstep(agents[0]):
        return f"{type(agents[0]).__name__} has no act_batch."
    first: dict[tuple[int, int], tuple[Control, str]] = {}
    try:
        for width in widths:
            for seating in _seatings(width, len(streams)):
                for place, stream, moment, control in _answers(agents[:width], seating, streams, watch or Watch()):
                    where = f"at place {place} of {width}"
                    known, there = first.setdefault((stream, moment), (control, where))
                    if repr(known) != repr(control):  # repr tells floats apart to the bit, and -0.0 from 0.0
                        told = f"act_batch gives {known} {there} and {control} {where}"
                        return f"{told} for the same observation in other company. {_ADVICE}"
    except AgentError as error:
        return f"{error}."
    return None


def _seatings(width: int, streams: int) -> Iterator[list[int]]:
    """Yield the stream of each row, in three ways: all mixed; stream 0 last among equal ones; stream 0 second."""
    yield list(islice(cycle(range(streams)), width))
    yield [1] * (width - 1) + [0]
    yield [streams - 1, 0] + [streams // 2] * (width - 2)


def _answers(
    agents: Sequence[Agent], seating: Sequence[int], streams: Sequence[Recording], watch: Watch
) -> Iterator[tuple[int, int, int, Control]]:
    """Yield (row, stream, moment, control) for every row and moment. Raises `AgentError`."""
    rows = [streams[stream] for stream in seating]
    for agent, row in zip(agents, rows, strict=True):
        watch.phase("reset", 0)
        agent_reset(agent, row.plan, row.seed)
    for moment in range(min(len(row.observations) for row in streams)):
        given = tuple(row.observations[moment].private() for row in rows)
        watch.phase("act", moment)
        answers = agent_act_batch(agents, given)
        watch.phase("sim", moment)
        for place, answer in enumerate(answers):
            if isinstance(answer, AgentError):
                raise answer
            yield place, seating[place], moment, answer
