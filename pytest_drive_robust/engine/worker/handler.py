"""What a worker does with a request: drive it, alone or with others, or score one that another process broke on."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Mapping
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, NamedTuple

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.contents import check_contents
from pytest_drive_robust.engine.messages import CHECK, DRIVE, SALVAGE, WorkerRequest, receive
from pytest_drive_robust.engine.shared_state import Phase, SharedState
from pytest_drive_robust.engine.worker.process_state import read_process_state, restore_process_state
from pytest_drive_robust.engine.worker.watched_agent import WatchedAgent
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.rescore import bare_result, drive_again

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.plan import EpisodeRequest
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["Reply", "RequestHandler"]


class Reply(NamedTuple):
    """The result of the request with this token; `is_last` when nothing is under way any more."""

    token: bytes
    result: EpisodeResult | UsageError
    is_last: bool = True


class RequestHandler:
    """The worlds and the agents of this process. `connection` is that to the other side."""

    def __init__(
        self, worker_setup: WorkerSetup, registry: Registry, state: SharedState, connection: Connection
    ) -> None:
        self._setup = worker_setup
        self._registry = registry
        self._state = state
        self._connection = connection
        self._driver = EpisodeDriver(
            self._make_world, self._make_agent, wrap=self._watched, on_tick=state.ticked, watch=state
        )
        self._process_states: dict[str, Mapping[int, Any]] = {}

    def replies(self, token: bytes, payload: bytes) -> Iterator[Reply]:
        """Do what is asked for. Yield more than one reply where requests that arrive meanwhile are driven, too."""
        asked: WorkerRequest = pickle.loads(payload)
        self._state.clear()
        known = self._process_states.get(asked.episode.agent)
        if known is not None:
            restore_process_state(known)  # the process is as it was when the agent was made
        together = asked.kind == DRIVE and asked.width is not None
        replies = self._drive_together(token, asked) if together else iter([Reply(token, self._result_of(asked))])
        for reply in replies:
            if reply.is_last:
                self._state.phase("idle", 0 if isinstance(reply.result, UsageError) else reply.result.ticks)
            yield reply

    def close(self) -> None:
        """Free the worlds and the agents."""
        self._driver.close()
        self._process_states.clear()

    def _result_of(self, asked: WorkerRequest) -> EpisodeResult | UsageError:
        try:
            request = asked.read(self._registry)
            return {DRIVE: self._drive, CHECK: self._check, SALVAGE: self._salvage}[asked.kind](request, asked)
        except UsageError as error:
            return error
        except BaseException as error:
            return self._broken(asked, error)

    def _drive(self, request: EpisodeRequest, asked: WorkerRequest) -> EpisodeResult:
        result = self._driver.drive_once(request)
        if result.outcome is Outcome.AGENT_ERROR:  # another one will be made, in the process as it is then
            self._process_states.pop(request.episode.agent, None)
        return result

    def _check(self, request: EpisodeRequest, asked: WorkerRequest) -> EpisodeResult:
        """May the agent be driven in lockstep? Not driven, and completed when it may.

        An `infra_error` says that there was nothing to ask about, because the episode broke at once. Raises
        `UsageError` when it must not.
        """
        outcome, end = Outcome.INFRA_ERROR, End.SIMULATION_CRASHED
        assert asked.width is not None
        self._state.phase("sim", 0)
        if self._driver.check(request, asked.width):
            outcome, end = Outcome.COMPLETED, End.COMPLETED
        return bare_result(request.route, request.episode, outcome=outcome, end=end, detail="")

    def _salvage(self, request: EpisodeRequest, asked: WorkerRequest) -> EpisodeResult:
        assert asked.recorded is not None
        episode, route = request.episode, request.route
        self._state.phase("sim", 0)
        world = self._driver.world()
        result = drive_again(world, asked.recorded, route=route, setting=request.setting, episode=episode)
        return with_machine(result, self._registry.entry("agents", episode.agent).load(), world)

    def _drive_together(self, token: bytes, first: WorkerRequest) -> Iterator[Reply]:
        """Drive the first request and all that arrive before none is under way any more; they are of one agent.

        What breaks all of them is told of each: whoever asked tries them again one by one.
        """
        unread = [(token, first)]
        under_way = {token: first}
        tokens: dict[int, bytes] = {}

        def take() -> EpisodeRequest | None:
            if not unread and self._connection.poll():
                token, payload = receive(self._connection)
                unread.append((token, pickle.loads(payload)))
            if not unread:
                return None
            token, asked = unread.pop()
            under_way[token] = asked
            request = asked.read(self._registry)
            tokens[id(request)] = token
            return request

        assert first.width is not None
        self._state.phase("sim", 0)
        driving = self._driver.drive_batch(first.episode.agent, take, first.width)
        while under_way:
            try:
                request, result = next(driving)
                ended: list[Reply] = [Reply(tokens.pop(id(request)), result)]
            except BaseException as error:
                refusal = error if isinstance(error, UsageError) and len(under_way) == 1 else None
                ended = [Reply(token, refusal or self._broken(asked, error)) for token, asked in under_way.items()]
            for reply in ended:
                del under_way[reply.token]
                if not under_way:
                    driving.close()  # before the state of the process is put back
                yield reply._replace(is_last=not under_way)

    def _broken(self, asked: WorkerRequest, error: BaseException) -> EpisodeResult:
        """Return what came of an episode when something was raised that is no fault of its agent.

        That is sys.exit() in a simulator, a perturbation that interrupts.
        """
        if self._state.read().phase is Phase.MAKE and not isinstance(error, Exception):
            raise error  # an agent that interrupts while it is made
        self.close()
        detail, end = blame("the simulation", error), End.SIMULATION_CRASHED
        return bare_result(asked.route, asked.episode, outcome=Outcome.INFRA_ERROR, end=end, detail=detail)

    def _make_world(self) -> Simulator:
        self._state.phase("sim", 0)
        return self._registry.simulator(self._setup.simulator, self._setup.options)

    def _make_agent(self, name: str) -> Agent:
        self._state.phase("make", 0)
        check_contents(self._registry, name, worker_setup=self._setup, world=self._driver.world)
        agent = make_agent(self._registry, name)
        self._setup.limit_threads()
        self._process_states.setdefault(name, read_process_state())
        self._state.phase("sim", 0)
        return agent

    def _watched(self, agent: Agent) -> Agent:
        return WatchedAgent(agent, self._state, self._connection.fileno())
