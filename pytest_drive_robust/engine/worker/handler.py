"""What a worker does with a request: drive it, or find out the score of one that another process broke on."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.lockstep.handler import LockstepHandler
from pytest_drive_robust.engine.messages import ALONE, CHECK, DRIVE, SALVAGE
from pytest_drive_robust.engine.shared_state import Phase, SharedState
from pytest_drive_robust.engine.worker.process_state import read_process_state, restore_process_state
from pytest_drive_robust.engine.worker.watched_agent import WatchedAgent
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.generators import seed_for
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.make_agent import make_agent
from pytest_drive_robust.runner.episode.rescore import RecordedControls, bare_result, drive_again

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.messages import Message, PickledRequest
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["RequestHandler"]


@dataclass
class RequestHandler:
    """The simulator and the agents of this process. `descriptor` is that of the connection to the other side."""

    worker_setup: WorkerSetup
    registry: Registry
    state: SharedState
    descriptor: int
    _simulator: Simulator | None = None
    _agents: dict[str, tuple[Agent, Mapping[str, Any]]] = field(default_factory=dict)
    lockstep: LockstepHandler = field(init=False)

    def __post_init__(self) -> None:
        self.lockstep = LockstepHandler(self.worker_setup, self.registry, self.state, self.descriptor)
        self._does: dict[bytes, Callable[..., EpisodeResult]] = {
            DRIVE: self._drive,
            SALVAGE: self._salvage,
            CHECK: self.lockstep.check,
            ALONE: self.lockstep.drive_alone,
        }

    def result_of(self, message: Message) -> EpisodeResult | UsageError:
        """Do what is asked for."""
        self.state.clear()
        try:
            asked = pickle.loads(message.payload)
            result = self._does[message.kind](*asked)
        except UsageError as error:
            self.state.enter(Phase.IDLE, 0)
            return error
        self.state.enter(Phase.IDLE, result.ticks)
        return result

    def close(self) -> None:
        """Free the world and the agents."""
        self._agents.clear()
        self.lockstep.close()
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def _drive(self, request: PickledRequest) -> EpisodeResult:
        episode = request.episode
        simulator, setting = self._opened_simulator(), request.read_setting(self.registry)
        own = self._made_agent(episode.agent)
        agent = WatchedAgent(own, self.state, self.descriptor)
        seed_for(episode)
        self.state.enter(Phase.SIM, 0)
        try:
            result = drive_episode(
                simulator,
                agent,
                route=request.route,
                setting=setting,
                seed=episode.seed,
                agent_name=episode.agent,
                on_tick=agent.ticked,
                watch=self.state,
            )
        except BaseException as error:  # sys.exit() in a simulator, a perturbation that interrupts
            detail = blame("the simulation", error)
            result = bare_result(
                request.route, episode, outcome=Outcome.INFRA_ERROR, end=End.SIMULATION_CRASHED, detail=detail
            )
        if result.outcome is Outcome.AGENT_ERROR:
            self._agents.pop(episode.agent, None)  # it may be in any state
        if result.outcome is Outcome.INFRA_ERROR:
            self.close()
        return with_machine(result, own)

    def _salvage(self, request: PickledRequest, recorded: RecordedControls) -> EpisodeResult:
        simulator, setting = self._opened_simulator(), request.read_setting(self.registry)
        self.state.enter(Phase.SIM, 0)
        result = drive_again(simulator, recorded, route=request.route, setting=setting, episode=request.episode)
        return with_machine(result, None)

    def _opened_simulator(self) -> Simulator:
        if self._simulator is None:
            self.state.enter(Phase.SIM, 0)
            self._simulator = self.registry.simulator(self.worker_setup.simulator, self.worker_setup.options)
        return self._simulator

    def _made_agent(self, name: str) -> Agent:
        """Return the agent of that name, with the process as it was when the agent was made."""
        if name in self._agents:
            agent, process_state = self._agents[name]
            restore_process_state(process_state)
            return agent
        self.state.enter(Phase.MAKE, 0)
        agent = make_agent(self.registry, name)
        self.worker_setup.limit_threads()
        self._agents[name] = agent, read_process_state()
        return agent
