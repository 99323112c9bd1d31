"""In a worker process: the episodes that are driven in lockstep."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Mapping, Sequence
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, Protocol

from pytest_drive_robust.domain.agent import offers_lockstep
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.lockstep.watched_agent import BatchedAgent
from pytest_drive_robust.engine.messages import REFUSED, RESULT, Message, receive, refusal_bytes
from pytest_drive_robust.engine.shared_state import Phase, SharedState
from pytest_drive_robust.engine.worker.process_state import read_process_state, restore_process_state
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.make_agent import make_agent
from pytest_drive_robust.runner.episode.rescore import bare_result
from pytest_drive_robust.runner.lockstep.admission import Admission
from pytest_drive_robust.runner.lockstep.local import LocalBatches
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.record import encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.truth import WorldState
    from pytest_drive_robust.engine.messages import PickledRequest
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.lockstep.local import Ended
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["LockstepHandler"]


class _Reply(Protocol):
    def __call__(self, token: bytes, kind: bytes, body: bytes, *, over: bool = True) -> None: ...


class LockstepHandler:
    """Drives in lockstep what one process is asked for; worlds and agents of one agent's name are kept."""

    def __init__(self, worker_setup: WorkerSetup, registry: Registry, state: SharedState, descriptor: int) -> None:
        self._setup = worker_setup
        self._registry = registry
        self._state = state
        self._descriptor = descriptor
        self._batches: LocalBatches | None = None
        self._process_states: dict[str, Mapping[str, Any]] = {}
        self._asked: Control | None = None
        self._alone = False

    def check(self, order: PickledRequest, width: int) -> EpisodeResult:
        """May the agent be driven in lockstep? Not driven: completed when it may, an agent error when it must not.

        An `infra_error` says that there was nothing to ask about, because the episode broke at once.
        """
        admission = Admission(recorded=True, problem="it has no act_batch.")
        request = self.read(order)
        if offers_lockstep(self._make(order.episode.agent)):
            admission = self._ready(width).check(request)
        outcome, end = Outcome.INFRA_ERROR, End.SIMULATION_CRASHED
        if admission.recorded:
            passed = admission.problem is None
            outcome, end = (Outcome.COMPLETED, End.COMPLETED) if passed else (Outcome.AGENT_ERROR, End.AGENT_CRASHED)
        return bare_result(order.route, order.episode, outcome=outcome, end=end, detail=admission.problem or "")

    def drive_alone(self, order: PickledRequest, width: int) -> EpisodeResult:
        """Drive one episode in a batch of its own, and share what scoring it without its agent would take."""
        request = self.read(order)
        self._alone = True
        try:
            ((_, result),) = self._drive(request.episode.agent, iter([request]), width)
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
        order, width = pickle.loads(first.payload)
        arriving = _Arriving(self, first, connection, reply)
        driving = self._drive(order.episode.agent, arriving, width)
        for request, result in driving:
            token = arriving.tokens.pop(id(request))[0]
            over = not arriving.tokens
            if over:
                driving.close()  # before the state of the process is put back
                self._state.enter(Phase.IDLE, result.ticks)
            reply(token, RESULT, encode_episode(result), over=over)
            if over:
                return

    def close(self) -> None:
        """Close the worlds and drop the agents. Calling it twice does no harm."""
        if self._batches is not None:
            self._batches.close()

    def read(self, order: PickledRequest) -> EpisodeRequest:
        """Raises `UsageError` for a setting that cannot be had here."""
        return EpisodeRequest(order.episode, order.route, order.read_setting(self._registry))

    def _drive(self, agent: str, requests: Iterator[EpisodeRequest], width: int) -> Ended:
        """See `LocalBatches.drive_batch`, in the state of the process in which the agent was made."""
        if agent in self._process_states:
            restore_process_state(self._process_states[agent])
        self._state.enter(Phase.SIM, 0)
        return self._ready(width).drive_batch(agent, requests)

    def _ready(self, width: int) -> LocalBatches:
        if self._batches is None:
            self._batches = LocalBatches(
                self._make_world,
                self._make,
                width=width,
                wrap=lambda agent: BatchedAgent(agent, self._state, self._descriptor, self._answered),
                watch=self._state,
                on_tick=self._ticked,
            )
        return self._batches

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


class _Arriving:
    """The requests that have arrived. There may be none now and another one later."""

    def __init__(self, handler: LockstepHandler, first: Message, connection: Connection, reply: _Reply) -> None:
        self._handler = handler
        self._reply = reply
        self._connection = connection
        self._first: Message | None = first
        self.tokens: dict[int, tuple[bytes, EpisodeRequest]] = {}

    def __iter__(self) -> Iterator[EpisodeRequest]:
        return self

    def __next__(self) -> EpisodeRequest:
        while (message := self._next_message()) is not None:
            order, _ = pickle.loads(message.payload)
            try:
                request = self._handler.read(order)
            except UsageError as error:
                self._reply(message.token, REFUSED, refusal_bytes(error), over=not self.tokens)
                continue
            self.tokens[id(request)] = message.token, request
            return request
        raise StopIteration

    def _next_message(self) -> Message | None:
        if self._first is not None:
            message, self._first = self._first, None
            return message
        return receive(self._connection) if self._connection.poll() else None
