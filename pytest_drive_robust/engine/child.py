"""In a child process: wait for an episode, drive it, answer, put everything back."""

from __future__ import annotations

import faulthandler
import json
import os
import pickle
import signal
import struct
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.board import Board, Phase
from pytest_drive_robust.engine.frames import BrokenStreamError, Frame, read_frame, write_frame
from pytest_drive_robust.engine.kernel import limit_memory
from pytest_drive_robust.engine.leftovers import Leftovers, resident_bytes
from pytest_drive_robust.engine.surroundings import read_surroundings, restore_surroundings
from pytest_drive_robust.engine.watched import CUT_OFF, WatchedAgent
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.contract import blame
from pytest_drive_robust.runner.generators import seed_for, seed_generators
from pytest_drive_robust.runner.loop import drive_episode
from pytest_drive_robust.runner.machine import machine_facts, with_machine
from pytest_drive_robust.runner.salvage import Wreck, bare_result, drive_again
from pytest_drive_robust.store.record import encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.order import Order
    from pytest_drive_robust.engine.recipe import Recipe
    from pytest_drive_robust.registry import Registry
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["DRIVE", "REFUSED", "RESULT", "SALVAGE", "Channels", "serve", "split_answer"]

DRIVE, SALVAGE, RESULT, REFUSED = b"D", b"S", b"R", b"U"
_LENGTH = struct.Struct("<I")
_FATAL = (signal.SIGSEGV, signal.SIGFPE, signal.SIGABRT, signal.SIGBUS, signal.SIGILL)
_PRIVATE_FROM = 600
"""Our descriptors get numbers from here on, out of the way of code that closes the low ones."""


class Channels(NamedTuple):
    """The descriptors that a child gets: for messages, for what is printed, for faulthandler, of the board."""

    messages: int
    output: int
    faults: int
    board: int


def serve(channels: Channels, recipe: Recipe, limits: Limits, registry: Registry) -> None:
    """Drive what is asked for until the other side closes the channel."""
    messages, faults = _private(channels.messages), _private(channels.faults)
    _redirect(channels.output)
    board = Board(channels.board)
    os.close(channels.board)
    limit_memory(limits.memory_bytes)
    driver = _Driver(recipe, registry, board, messages)
    leftovers = Leftovers((0, 1, 2, messages, faults))
    machine_facts()  # before an agent can change what numpy does
    own = os.getpid()
    while True:
        try:
            request = read_frame(messages)
        except (BrokenStreamError, OSError):
            return
        if request is None:
            driver.close()
            return
        _tell_faults(faults)
        kind, answer = driver.answer(request)
        if os.getpid() != own:  # the agent forked, and this is the copy: one answer is enough
            os._exit(0)
        notes = {
            "rss": resident_bytes(),
            "leftovers": [*driver.put_back(), *leftovers.found()],
        }
        try:
            write_frame(messages, Frame(kind, request.token, _joined(notes, answer)))
        except OSError:
            os._exit(CUT_OFF)


def split_answer(payload: bytes) -> tuple[Mapping[str, Any], bytes]:
    """The notes of an answer, and what was answered. Raises `ValueError` for anything else."""
    try:
        (length,) = _LENGTH.unpack_from(payload)
        notes = json.loads(payload[_LENGTH.size : _LENGTH.size + length])
        int(notes["rss"]), list(notes["leftovers"])
    except (struct.error, KeyError, TypeError) as error:
        raise ValueError(f"no answer: {error}") from error
    return notes, payload[_LENGTH.size + length :]


def _joined(notes: Mapping[str, Any], answer: bytes) -> bytes:
    text = json.dumps(notes).encode()
    return _LENGTH.pack(len(text)) + text + answer


@dataclass
class _Driver:
    """The world and the agents of this process."""

    recipe: Recipe
    registry: Registry
    board: Board
    channel: int
    _simulator: Simulator | None = None
    _agents: dict[str, tuple[Agent, Mapping[str, Any]]] = field(default_factory=dict)
    _start: Mapping[str, Any] = field(default_factory=read_surroundings)

    def answer(self, request: Frame) -> tuple[bytes, bytes]:
        """The kind of answer and its bytes."""
        self.board.clear()
        try:
            asked = pickle.loads(request.payload)
            result = self._drive(asked) if request.kind == DRIVE else self._salvage(*asked)
        except UsageError as error:
            self.board.enter(Phase.IDLE, 0)
            return REFUSED, json.dumps({"type": type(error).__name__, "text": str(error)}).encode()
        self.board.enter(Phase.IDLE, result.ticks)
        return RESULT, encode_episode(result)

    def put_back(self) -> tuple[str, ...]:
        """Make the process as it was; the names of what cannot be."""
        return restore_surroundings(self._start)

    def close(self) -> None:
        """Free the world and the agents."""
        self._agents.clear()
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def _drive(self, order: Order) -> EpisodeResult:
        episode = order.episode
        simulator, setting = self._world(), order.read_setting(self.registry)
        own = self._agent(episode.agent)
        agent = WatchedAgent(own, self.board, self.channel)
        seed_for(episode)
        self.board.enter(Phase.SIM, 0)
        try:
            result = drive_episode(
                simulator,
                agent,
                route=order.route,
                setting=setting,
                seed=episode.seed,
                agent_name=episode.agent,
                on_tick=agent.ticked,
                watch=self.board,
            )
        except BaseException as error:  # sys.exit() in a simulator, a perturbation that interrupts
            detail = blame("the simulation", error)
            result = bare_result(
                order.route, episode, outcome=Outcome.INFRA_ERROR, end=End.SIMULATION_CRASHED, detail=detail
            )
        if result.outcome is Outcome.AGENT_ERROR:
            self._agents.pop(episode.agent, None)  # it may be in any state
        if result.outcome is Outcome.INFRA_ERROR:
            self.close()
        return with_machine(result, own)

    def _salvage(self, order: Order, wreck: Wreck) -> EpisodeResult:
        simulator, setting = self._world(), order.read_setting(self.registry)
        self.board.enter(Phase.SIM, 0)
        result = drive_again(simulator, wreck, route=order.route, setting=setting, episode=order.episode)
        return with_machine(result, None)

    def _world(self) -> Simulator:
        if self._simulator is None:
            self.board.enter(Phase.SIM, 0)
            self._simulator = self.registry.simulator(self.recipe.simulator, self.recipe.options)
        return self._simulator

    def _agent(self, name: str) -> Agent:
        """The agent of that name, in the surroundings that it was made in."""
        if name in self._agents:
            agent, surroundings = self._agents[name]
            restore_surroundings(surroundings)
            return agent
        seed_generators(f"making {name}")
        self.board.enter(Phase.MAKE, 0)
        agent = self.registry.agent(name)
        self.recipe.limit_threads()
        self._agents[name] = agent, read_surroundings()
        return agent


def _tell_faults(fd: int) -> None:
    """Have the place of a fatal error written to `fd`, and nobody else's handler after ours: pygame installs some."""
    faulthandler.disable()
    for number in _FATAL:
        signal.signal(number, signal.SIG_DFL)
    faulthandler.enable(file=fd, all_threads=False)


def _private(number: int) -> int:
    """The same file under a high number that is closed on exec."""
    import fcntl

    try:
        moved = fcntl.fcntl(number, fcntl.F_DUPFD_CLOEXEC, _PRIVATE_FROM)
    except OSError:  # fewer descriptors are allowed
        return number
    os.close(number)
    return moved


def _redirect(output: int) -> None:
    """Make the descriptor the standard output and error; nothing is to be read."""
    nothing = os.open(os.devnull, os.O_RDONLY)
    for source, target in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(source, target)
    os.close(nothing)
    os.close(output)
    sys.stdin = sys.__stdin__ = os.fdopen(0, closefd=False)  # type: ignore[misc]
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = os.fdopen(number, "w", 1, encoding="utf-8", errors="backslashreplace", closefd=False)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
