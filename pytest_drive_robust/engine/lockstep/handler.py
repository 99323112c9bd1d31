"""In a worker process: the episodes that are driven in lockstep."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, Protocol

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.lockstep.watched_agent import BatchedAgent
from pytest_drive_robust.engine.messages import Message, receive
from pytest_drive_robust.engine.shared_state import Phase, SharedState
from pytest_drive_robust.engine.worker.process_state import read_process_state, restore_process_state
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.make_agent import make_agent
from pytest_drive_robust.runner.episode.rescore import bare_result
from pytest_drive_robust.runner.lockstep.lockstep import Lockstep
from pytest_drive_robust.runner.plan import EpisodeRequest

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.truth import WorldState
    from pytest_drive_robust.engine.messages import PickledRequest
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["LockstepHandler"]


class _Reply(Protocol):
    def __call__(self, token: bytes, result: EpisodeResult | UsageError, *, over: bool = True) -> None: ...


class LockstepHandler:
    """Drives in lockstep what one process is asked for; worlds and agents of one agent's name are kept."""

    def __init__(self, worker_setup: WorkerSetup, registry: Registry, state: SharedState, descriptor: int) -> None:
        self._setup = worker_setup
        self._registry = registry
        self._state = state
        self._descriptor = descriptor
        self._lockstep: Lockstep | None = None
        self._process_states: dict[str, Mapping[str, Any]] = {}
        self._asked: Control | None = None
        self._alone = False

    def check(self, order: PickledRequest, width: int) -> EpisodeResult:
        """May the agent be driven in lockstep? Not driven, and completed when it may.

        An `infra_error` says that there was nothing to ask about, because the episode broke at once. Raises
        `UsageError` when it must not.
        """
        may_share = self._ready(order, width).check(self._read(order))
        outcome, end = (
            (Outcome.COMPLETED, End.COMPLETED) if may_share else (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED)
        )
        return bare_result(order.route, order.episode, outcome=outcome, end=end, detail="")

    def drive_alone(self, order: PickledRequest, width: int) -> EpisodeResult:
        """Drive one episode in a batch of its own, and share what scoring it without its agent would take."""
        request = self._read(order)
        self._alone = True
        try:
            result = self._ready(order, width).drive_one(request)
        except UsageError:
            raise
        except BaseException as error:  # sys.exit() in a simulator, a perturbation that interrupts
            detail = blame("the simulation", error)
            result = bare_result(
                order.route, order.episode, outcome=Outcome.INFRA_ERROR, end=End.SIMULATION_CRASHED, detail=detail
            )
        finally:
            self._alone = False
        if result.outcome is Outcome.INFRA_ERROR:
            self.close()
        return result

    def drive_together(self, first: Message, connection: Connection, reply: _Reply) -> None:
        """Drive the first request and all that arrive on `connection` before none is under way any more.

        They are all of one agent. `reply` gets the token of the request; the last one is `over`. What an episode raises
        that is no fault of its agent (`SystemExit` of a simulator) ends the process: each is then tried in one of its
        own.
        """
        self._state.clear()
        unread = [first]
        under_way: dict[int, tuple[bytes, EpisodeRequest]] = {}

        def take() -> EpisodeRequest | None:
            while unread or connection.poll():
                message = unread.pop() if unread else receive(connection)
                order, _ = pickle.loads(message.payload)
                try:
                    request = self._read(order)
                except UsageError as error:
                    reply(message.token, error, over=not under_way)
                else:
                    under_way[id(request)] = message.token, request
                    return request
            return None

        order, width = pickle.loads(first.payload)
        driving = self._ready(order, width).drive_batch(order.episode.agent, take)
        for request, result in driving:
            token, _ = under_way.pop(id(request))
            over = not under_way
            if over:
                driving.close()  # before the state of the process is put back
                self._state.enter(Phase.IDLE, result.ticks)
            reply(token, result, over=over)
            if over:
                return

    def close(self) -> None:
        """Close the worlds and drop the agents. Calling it twice does no harm."""
        if self._lockstep is not None:
            self._lockstep.close()

    def _read(self, order: PickledRequest) -> EpisodeRequest:
        """Raises `UsageError` for a setting that cannot be had here."""
        return EpisodeRequest(order.episode, order.route, order.read_setting(self._registry))

    def _ready(self, order: PickledRequest, width: int) -> Lockstep:
        """Return what drives, with the process as it was when the agent was made."""
        if order.episode.agent in self._process_states:
            restore_process_state(self._process_states[order.episode.agent])
        self._state.enter(Phase.SIM, 0)
        if self._lockstep is None:
            self._lockstep = Lockstep(
                self._make_world,
                self._make,
                width=width,
                wrap=lambda agent: BatchedAgent(agent, self._state, self._descriptor, self._answered),
                watch=self._state,
                on_tick=self._ticked,
            )
        return self._lockstep

    def _answered(self, answers: object) -> None:
        """Keep what the first row of a batch was told: the control of an episode that is driven alone."""
        self._asked = answers[0] if isinstance(answers, Sequence) and answers else None

    def _ticked(self, tick: int, state: WorldState, observation: Observation, applied: Control) -> None:
        if self._alone:
            self._state.add(tick, self._asked, applied, state.ego)
        self._asked = None

    def _make_world(self) -> Simulator:
        self._state.enter(Phase.SIM, 0)
        return self._registry.simulator(self._setup.simulator, self._setup.options)

    def _make(self, name: str) -> Agent:
        self._state.enter(Phase.MAKE, 0)
        agent = make_agent(self._registry, name)
        self._setup.limit_threads()
        self._process_states.setdefault(name, read_process_state())
        self._state.enter(Phase.SIM, 0)
        return agent
