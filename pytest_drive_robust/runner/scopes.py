"""What each test drives over: the options of the run, changed by the test's marker."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import RouteError, UsageError
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.perturbations.stack import RunningStack
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.as_in_worker import in_folder
from pytest_drive_robust.runner.before_driving import check_factory, check_route, routes_of
from pytest_drive_robust.runner.cache_key.identity import identify, identity_of
from pytest_drive_robust.runner.cache_key.source_files import python_files, source_digest
from pytest_drive_robust.runner.cache_key.weights import FileStates, states_of_weights
from pytest_drive_robust.runner.episode.machine import library_versions
from pytest_drive_robust.runner.lockstep.offered import factory_offers_lockstep
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions
from pytest_drive_robust.simulators.routes import default_spec
from pytest_drive_robust.store.events import Identified

_OWN = __name__.partition(".")[0]


def simulator_options(options: RunOptions) -> SimulatorOptions:
    """Return the options that the world of a run is made with."""
    return SimulatorOptions(stuck_stop_s=options.stuck_stop_s)


def check_severities(setting: Setting, dt_s: float) -> None:
    """Raise `PerturbationError` for a severity that a tick of `dt_s` seconds cannot show.

    The route and the cameras are not known yet, so a `reset` that needs them may raise anything here. Such an error is
    ignored: an episode has both, and reports the error if `reset` raises there.
    """
    for perturbation in setting.perturbations:
        try:
            RunningStack.of(Setting.of(perturbation), route_id="", seed=0, dt_s=dt_s, cameras=())
        except UsageError:  # noqa: PERF203 - one that raises hides no other
            raise
        except Exception:
            continue


class Scopes:
    """Resolves names to scopes, each name once. `load_routes` turns a routes spec into routes.

    With `lockstep`, agents that offer `act_batch` are driven in lockstep, which is part of an episode's identity.
    `is_stored` returns whether the episode of a key is stored: its route need not be checked again.
    """

    def __init__(
        self,
        options: RunOptions,
        registry: Registry,
        load_routes: Callable[[str], tuple[Route, ...]],
        *,
        lockstep: bool = False,
        is_stored: Callable[[str], bool] = lambda key: False,
    ) -> None:
        self._options = options
        self._registry = registry
        self._load_routes = load_routes
        self._lockstep = lockstep
        self._is_stored = is_stored
        self._problems: dict[str, list[str]] = {}
        self._routes: dict[str, tuple[Route, ...]] = {}
        self._identities: dict[str, str] = {}
        self._weights: dict[str, FileStates] = {}  # states of their files, by agent
        self._sources: dict[str, str] = {}  # digests of their code, by agent
        self._began_s = time.time()
        self._folder = os.getcwd()  # paths of weights may start here, and a test may change the folder

    def routes(self, spec: str) -> tuple[Route, ...]:
        """Return the routes of a spec. Raises `UsageError` when there is no such set or file."""
        if spec not in self._routes:
            self._routes[spec] = routes_of(spec, self._simulator, self._load_routes)
        return self._routes[spec]

    def of(self, marker: MarkerOptions) -> Scope:
        """Return the scope of a test with this marker.

        Raises `UsageError` for unknown agents, lost weights, and routes that are unknown or cannot be driven.
        """
        agent = marker.agent or self._options.agent
        identity = self._identity(agent)
        routes_spec = marker.routes or default_spec(
            self._options.routes, self._simulator, given=self._options.routes_given
        )
        routes, seeds = self.routes(routes_spec), marker.seeds or self._options.seeds
        scope = Scope(agent, routes_spec, routes, seeds, identity)
        self._check_routes(scope)
        return scope

    def require_unchanged(self, agent: str) -> None:
        """Raise `UsageError` when the weights of an agent have changed since its keys were made.

        Otherwise episodes of the new weights would be stored under, or read by, the keys of the old weights.
        """
        if agent not in self._identities:
            return
        with in_folder(self._folder):
            states = states_of_weights(self._factory(agent))
            changed = states != self._weights[agent] and self._made_identity(agent) != self._identities[agent]
        if changed:
            raise UsageError(
                f"the weights of the agent {agent!r} changed after the tests were collected. Stored episodes are found "
                "by the content of the weights, so the weights must not change during a run. Write them before pytest "
                "starts, or while conftest.py is imported."
            )
        self._weights[agent] = states  # rewritten with the same content

    def require_unchanged_code(self) -> None:
        """Raise `UsageError` where a Python file of an agent was edited after its keys were made.

        Call after the worker processes have loaded the code: later edits do not change what they drive. Other files of
        the agent's package do not count, because an agent may write them itself. A worker process checks what it loads
        itself (`sources`).
        """
        for agent, digest in tuple(self._sources.items()):
            factory = self._factory(agent)
            if source_digest(factory) == digest:
                continue
            edited = [file for file in python_files(factory) if os.stat(file).st_mtime > self._began_s]
            if edited:
                raise UsageError(
                    f"{edited[0]}, a file of the agent {agent!r}, changed after the tests were collected. Stored "
                    "episodes are found by the content of such files. Run again, and edit no file of the agent before "
                    "the first episode begins."
                )

    def sources(self) -> tuple[tuple[str, str], ...]:
        """Return (file, digest) of each Python file of the agents, the simulator and the perturbations not ours."""
        simulator = self._registry.entry("simulators", self._options.simulator).load()
        targets = (*map(self._factory, self._sources), simulator, *self._registry.perturbations().values())
        others = [target for target in targets if not str(getattr(target, "__module__", "")).startswith(f"{_OWN}.")]
        return tuple({str(file): digest for target in others for file, digest in python_files(target).items()}.items())

    def identify(self, scope: Scope) -> Identified:
        """Return the digests of a scope's agent and routes. Raises `UsageError` for weights that cannot be read."""
        identified = identify(scope, self._registry)
        self._sources[scope.agent] = identified.source
        return identified

    def check(self, marked: MarkerOptions | None = None) -> None:
        """Raise `UsageError` when the run's own agent, simulator or routes cannot be used.

        When the run names no agent, or no routes, but every test's marker does, those of `marked` are checked instead:
        the defaults of the run are not used then and may be missing.
        """
        options, marked = self._options, marked or MarkerOptions()
        self._registry.require("simulators", options.simulator)
        agent = None if options.agent_given else marked.agent
        routes = None if options.routes_given else marked.routes
        self.of(MarkerOptions(agent=agent, routes=routes))

    def setting(self, sentence: str) -> Setting:
        """Return the setting of a sentence. Raises `UsageError` for a sentence that does not parse."""
        return Setting.parse(sentence, self._registry.perturbations())

    def check_setting(self, setting: Setting) -> None:
        """Raise `PerturbationError` for a severity that the simulator's tick cannot show, such as 20 ms at 20 Hz."""
        check_severities(setting, self.dt_s)

    def check_requests(self, requests: Iterable[EpisodeRequest]) -> None:
        """Raise `UsageError` when an episode of the plan cannot be provided. Our simulators can drive every episode."""

    def advice(self) -> list[str]:
        """Return sentences of advice about the scopes, to show before driving."""
        return []

    @property
    def agents(self) -> tuple[str, ...]:
        """The agents that scopes were made for, sorted."""
        return tuple(sorted(self._identities))

    @property
    def dt_s(self) -> float:
        """Return the length of a tick of the run's simulator in seconds."""
        return self._simulator.dt_s

    def versions_of(self, agent: str) -> Mapping[str, str]:
        """Return the versions that the agent's episodes will record, as far as they are known before driving."""
        libraries = library_versions(self._registry.entry("agents", agent).load())
        return {**libraries, **{str(name): str(version) for name, version in self._simulator.versions().items()}}

    def _identity(self, agent: str) -> str:
        """Return the identity of an agent. Raises `UsageError` for an unknown agent, and when its `check` fails."""
        if agent not in self._identities:
            self._registry.require("agents", agent)
            with in_folder(self._folder):
                check_factory(agent, self._factory(agent))
                self._weights[agent] = states_of_weights(self._factory(agent))  # before the identity reads the files
                self._identities[agent] = self._made_identity(agent)
        return self._identities[agent]

    def _made_identity(self, agent: str) -> str:
        """Return the identity of an agent as it is now."""
        together = self._lockstep and factory_offers_lockstep(agent, self._registry)
        return identity_of(
            agent,
            self._registry,
            simulator=self._options.simulator,
            world=self._simulator,
            options=simulator_options(self._options),
            mode="lockstep" if together else "single",
        )

    def _factory(self, agent: str) -> object:
        return self._registry.entry("agents", agent).load()

    def _check_routes(self, scope: Scope) -> None:
        """Raise one `RouteError` that names every route that the simulator cannot drive."""
        if scope.routes_spec not in self._problems and hasattr(self._simulator, "check_route"):
            self._problems[scope.routes_spec] = list(self._problems_of(scope))
        problems = self._problems.get(scope.routes_spec)
        if problems:
            told = f"{len(problems)} of {len(scope.routes)} routes cannot be driven:"
            raise RouteError("\n  ".join([told, *problems]))

    def _problems_of(self, scope: Scope) -> Iterator[str]:
        requests = scope.need(Setting.CLEAN, clean=False).perturbed
        driven = {request.route.id for request in requests if self._is_stored(request.key)}
        for route in scope.routes:
            if route.id not in driven:
                try:
                    check_route(self._simulator, route)
                except UsageError as error:
                    yield str(error)

    @cached_property
    def _simulator(self) -> Simulator:
        """A world that answers questions and is never driven."""
        self._registry.require("simulators", self._options.simulator)
        return self._registry.simulator(self._options.simulator, simulator_options(self._options))
