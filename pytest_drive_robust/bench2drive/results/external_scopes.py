"""The scopes of tests that none of our simulators drives: the official evaluator drives, or has driven before."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from pytest_drive_robust.bench2drive.results.motion_log import TICK_S
from pytest_drive_robust.bench2drive.results.results_executor import ResultsExecutor
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.cache_key.identity import route_digest
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope
from pytest_drive_robust.runner.scopes import Scopes
from pytest_drive_robust.store.events import Identified

if TYPE_CHECKING:  # this module needs fcntl, and results are also read on systems without fcntl
    from pytest_drive_robust.bench2drive.evaluator.executor import Bench2DriveExecutor


class ExternalScopes(Scopes):
    """Scopes over the routes of an executor that has routes of its own (`supply`).

    Agents are only names: no agent is loaded and no world is built.
    """

    def __init__(
        self,
        options: RunOptions,
        registry: Registry,
        load_routes: Callable[[str], tuple[Route, ...]],
        supply: ResultsExecutor | Bench2DriveExecutor,
    ) -> None:
        super().__init__(options, registry, load_routes)
        self._supply = supply

    @property
    def dt_s(self) -> float:
        """Bench2Drive's tick in seconds."""
        return TICK_S

    def versions_of(self, agent: str) -> Mapping[str, str]:
        """Return no versions: only the episodes tell with which versions they were driven."""
        return {}

    def of(self, marker: MarkerOptions) -> Scope:
        """Return the scope of a test with this marker. Raises `UsageError` for unknown routes."""
        own = self._options.simulator
        spec = marker.routes or (self._options.routes if self._options.routes_given else own)
        agent, seeds = marker.agent or self._options.agent, marker.seeds or self._options.seeds
        return Scope(agent, spec, self.routes(spec), seeds, own)

    def routes(self, spec: str) -> tuple[Route, ...]:
        """Return all routes of the supply, some of them by id, or those of a route file. Raises `UsageError`."""
        if spec == self._options.simulator:
            return self._supply.routes
        try:
            return self._named([name.strip() for name in spec.split(",")])
        except UnknownNameError as unknown:
            try:
                return self._load_routes(spec)
            except UnknownNameError:
                if spec.endswith(".xml"):
                    raise
                raise unknown from None

    def identify(self, scope: Scope) -> Identified:
        """Return the identity of an agent that drives outside of this process: only its routes are known."""
        routes = tuple(f"{route.id}={route_digest(route)}" for route in scope.routes)
        return Identified(agent=scope.agent, distribution=self._options.simulator, source="", weights="", routes=routes)

    def check(self, marked: MarkerOptions | None = None) -> None:
        """Do nothing: the supply was checked when it was made."""

    def check_requests(self, requests: Iterable[EpisodeRequest]) -> None:
        """Raise one `UsageError` that names every request that the supply cannot answer."""
        self._supply.check(requests)

    def _named(self, names: Sequence[str]) -> tuple[Route, ...]:
        by_id = {route.id: route for route in self._supply.routes}
        unknown = [name for name in names if name not in by_id]
        if unknown:
            raise UnknownNameError.of(f"route of {self._options.simulator}", unknown[0], by_id)
        return tuple(by_id[name] for name in dict.fromkeys(names))


class ResultsScopes(ExternalScopes):
    """Scopes over existing results. Without named routes, an evaluation that has not ended raises `UsageError`."""

    def __init__(
        self,
        options: RunOptions,
        registry: Registry,
        load_routes: Callable[[str], tuple[Route, ...]],
        results: ResultsExecutor,
    ) -> None:
        super().__init__(options, registry, load_routes, results)
        self._results = results
        self._seeds: set[int] = set()
        self._takes_all = False

    def of(self, marker: MarkerOptions) -> Scope:
        """Return the scope of a test with this marker. Raises `UsageError`, also for unfinished results."""
        scope = super().of(marker)
        self._seeds.update(scope.seeds)
        return scope

    def routes(self, spec: str) -> tuple[Route, ...]:
        """Return routes as `ExternalScopes` does. Raises `UsageError` for all routes of an unfinished evaluation."""
        if spec == self._options.simulator:
            self._results.require_finished()
            self._takes_all = True
        return super().routes(spec)

    def advice(self) -> list[str]:
        """Return sentences about records of other seeds than the given ones, and about results without a plan."""
        left_out = self._results.left_out(self._seeds) if self._seeds else ""
        unplanned = self._results.unplanned() if self._takes_all else ()
        return [sentence for sentence in (left_out, *unplanned) if sentence]
