"""Handles a worker's requests: drives an episode, alone or in a batch, or scores one that broke another process."""

from __future__ import annotations

import pickle
import platform
from collections.abc import Iterator, Mapping
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine.messages import WorkerRequest, receive
from pytest_drive_robust.engine.shared_state import Phase, SharedState
from pytest_drive_robust.engine.worker.loaded_code import LoadedCode
from pytest_drive_robust.engine.worker.process_state import read_process_state, restore_process_state
from pytest_drive_robust.engine.worker_setup import WorkerSetup
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.cache_key.identity import identity_of
from pytest_drive_robust.runner.driver import EpisodeDriver, make_agent
from pytest_drive_robust.runner.episode.bare_result import bare_result
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.runner.episode.machine import with_machine
from pytest_drive_robust.runner.episode.recorded_ticks import RecordedTicks, drive_again
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import Simulator


class Reply(NamedTuple):
    """The result of the request with `token`; `is_last` is True when no other request is under way."""

    token: bytes
    result: EpisodeResult | UsageError
    is_last: bool = True


class RequestHandler:
    """Answers requests with the worlds and agents of this process. `connection` leads to the supervisor.

    `code` checks what an episode has loaded.
    """

    def __init__(
        self,
        worker_setup: WorkerSetup,
        registry: Registry,
        state: SharedState,
        connection: Connection,
        code: LoadedCode,
    ) -> None:
        self._setup = worker_setup
        self._registry = registry
        self._state = state
        self._connection = connection
        self._code = code
        self._driver = EpisodeDriver(self._make_world, self._make_agent, watch=state)
        self._process_states: dict[str, Mapping[int, Any]] = {}
        self._checked: set[tuple[str, str]] = set()

    def replies(self, token: bytes, payload: bytes) -> Iterator[Reply]:
        """Handle the request in `payload` and yield its reply; in a batch, yield replies to later requests, too."""
        asked: WorkerRequest = pickle.loads(payload)
        self._state.clear()
        known = self._process_states.get(asked.episode.agent)
        if known is not None:
            restore_process_state(known)  # the process is as it was when the agent was made
        for reply in self._drive_together(token, asked) if asked.shares else [Reply(token, self._result_of(asked))]:
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
            if self._setup.checks_identity:
                self._check_identity(request)
            if asked.recorded is not None:
                return self._salvage(request, asked.recorded)
            result = self._driver.drive_once(request, asked.width)
            self._code.check()
            if result.outcome is Outcome.AGENT_ERROR:  # the next agent object is made anew: its process state counts
                self._process_states.pop(request.episode.agent, None)
            return result
        except UsageError as error:
            return error
        except BaseException as error:
            return self._broken(asked, error)

    def _check_identity(self, request: EpisodeRequest) -> None:
        """Raise `UsageError` when this process has another version of the agent or of this package than the request.

        Otherwise the result would be stored under the key of code that did not drive.
        """
        agent, setup = request.episode.agent, self._setup
        if (agent, request.identity) not in self._checked:
            world = self._driver.world()
            found = identity_of(agent, self._registry, simulator=setup.simulator, world=world, options=setup.options)
            if request.identity and found != request.identity:
                raise UsageError(
                    f"the node {platform.node()} has another version of the agent {agent!r}, its weights, the "
                    "simulator or a library than the machine where the run was started. Install the same versions on "
                    "every node, and keep weights in the folder of the run or under the same path everywhere."
                )
            self._checked.add((agent, request.identity))

    def _salvage(self, request: EpisodeRequest, recorded: RecordedTicks) -> EpisodeResult:
        self._state.phase("sim", 0)
        world = self._driver.world()
        result = drive_again(world, recorded, request)
        return with_machine(result, self._registry.entry("agents", request.episode.agent).load(), world)

    def _drive_together(self, token: bytes, first: WorkerRequest) -> Iterator[Reply]:
        """Drive the first request, and requests of its agent that arrive while one is under way, in a batch.

        An error that breaks the whole batch is the reply to each request: the supervisor tries them again one by one.
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
                self._code.check()
                ended: list[Reply] = [Reply(tokens.pop(id(request)), result)]
            except BaseException as error:
                refusal = error if isinstance(error, UsageError) and len(under_way) == 1 else None
                ended = [Reply(token, refusal or self._broken(asked, error)) for token, asked in under_way.items()]
            for reply in ended:
                del under_way[reply.token]
                if not under_way:
                    driving.close()  # before the process state is restored
                yield reply._replace(is_last=not under_way)

    def _broken(self, asked: WorkerRequest, error: BaseException) -> EpisodeResult:
        """Return the `infra_error` of an episode in which an error was raised that is not its agent's fault.

        Examples: `sys.exit()` in a simulator, a perturbation that raises `KeyboardInterrupt`.
        """
        if self._state.read().phase is Phase.MAKE and not isinstance(error, Exception):
            raise error  # the agent's constructor raised `SystemExit` or the like
        self.close()
        detail, end = blame("the simulation", error), End.SIMULATION_CRASHED
        return bare_result(asked.route, asked.episode, outcome=Outcome.INFRA_ERROR, end=end, detail=detail)

    def _make_world(self) -> Simulator:
        self._state.phase("sim", 0)
        return self._registry.simulator(self._setup.simulator, self._setup.options)

    def _make_agent(self, name: str) -> Agent:
        self._state.phase("make", 0)
        agent = make_agent(self._registry, name)
        self._setup.limit_threads()
        self._process_states.setdefault(name, read_process_state())
        self._state.phase("sim", 0)
        return agent
