"""What a child process does with an order: drive it, or find out the score of one that another process broke on."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.lockstep.handler import LockstepHandler
from pytest_drive_robust.engine.shared_state import Phase, SharedState
from pytest_drive_robust.engine.wire import ALONE, CHECK, DRIVE, REFUSED, RESULT, SALVAGE, refusal_bytes
from pytest_drive_robust.engine.worker.process_state import read_process_state, restore_process_state
from pytest_drive_robust.engine.worker.watched_agent import WatchedAgent
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.generators import seed_for
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.make_agent import make_agent
from pytest_drive_robust.runner.episode.rescore import RecordedControls, bare_result, drive_again
from pytest_drive_robust.store.record import encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.frames import Frame
    from pytest_drive_robust.engine.pickled_request import PickledRequest
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["RequestHandler"]


@dataclass
class RequestHandler:
    """The world and the agents of this process."""

    worker_setup: WorkerSetup
    registry: Registry
    board: SharedState
    channel: int
    _simulator: Simulator | None = None
    _agents: dict[str, tuple[Agent, Mapping[str, Any]]] = field(default_factory=dict)
    _start: Mapping[str, Any] = field(default_factory=read_process_state)
    lockstep: LockstepHandler = field(init=False)

    def __post_init__(self) -> None:
        self.lockstep = LockstepHandler(self.worker_setup, self.registry, self.board, self.channel)
        self._does: dict[bytes, Callable[..., EpisodeResult]] = {
            DRIVE: self._drive,
            SALVAGE: self._salvage,
            CHECK: self.lockstep.check,
            ALONE: self.lockstep.drive_alone,
        }

    def answer(self, request: Frame) -> tuple[bytes, bytes]:
        """The kind of answer and its bytes."""
        self.board.clear()
        try:
            asked = pickle.loads(request.payload)
            result = self._does[request.kind](*asked)
        except UsageError as error:
            self.board.enter(Phase.IDLE, 0)
            return REFUSED, refusal_bytes(error)
        self.board.enter(Phase.IDLE, result.ticks)
        return RESULT, encode_episode(result)

    def put_back(self) -> tuple[str, ...]:
        """Make the process as it was; the names of what cannot be."""
        return restore_process_state(self._start)

    def close(self) -> None:
        """Free the world and the agents."""
        self._agents.clear()
        self.lockstep.close()
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def _drive(self, order: PickledRequest) -> EpisodeResult:
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

    def _salvage(self, order: PickledRequest, recorded: RecordedControls) -> EpisodeResult:
        simulator, setting = self._world(), order.read_setting(self.registry)
        self.board.enter(Phase.SIM, 0)
        result = drive_again(simulator, recorded, route=order.route, setting=setting, episode=order.episode)
        return with_machine(result, None)

    def _world(self) -> Simulator:
        if self._simulator is None:
            self.board.enter(Phase.SIM, 0)
            self._simulator = self.registry.simulator(self.worker_setup.simulator, self.worker_setup.options)
        return self._simulator

    def _agent(self, name: str) -> Agent:
        """The agent of that name, in the surroundings that it was made in."""
        if name in self._agents:
            agent, surroundings = self._agents[name]
            restore_process_state(surroundings)
            return agent
        self.board.enter(Phase.MAKE, 0)
        agent = make_agent(self.registry, name)
        self.worker_setup.limit_threads()
        self._agents[name] = agent, read_process_state()
        return agent
