"""What each test judges when the results were produced elsewhere: no agent is loaded and no world is built."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.official.supply import ResultsExecutor
from pytest_drive_robust.runner.identity import route_digest
from pytest_drive_robust.runner.plan import Scope, Task
from pytest_drive_robust.runner.scopes import Scopes
from pytest_drive_robust.store.events import Identified

if TYPE_CHECKING:
    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.marker import MarkerOptions
    from pytest_drive_robust.perturbations.setting import Setting
    from pytest_drive_robust.registry import Registry
    from pytest_drive_robust.settings import Settings

__all__ = ["RESULTS", "ResultScopes"]

RESULTS = "results"
"""What stands in the place of a simulator's name."""
_TICK_S = 0.05


class ResultScopes(Scopes):
    """As `Scopes`, over the routes of result files. Agents are only names here."""

    def __init__(
        self,
        settings: Settings,
        registry: Registry,
        load_routes: Callable[[str], tuple[Route, ...]],
        results: ResultsExecutor,
    ) -> None:
        super().__init__(settings, registry, load_routes)
        self._results = results

    @property
    def dt_s(self) -> float:
        """Bench2Drive's tick in seconds."""
        return _TICK_S

    def of(self, marker: MarkerOptions) -> Scope:
        """The scope of a test with this marker. Raises `UsageError` for unknown routes."""
        spec = marker.routes or (self._settings.routes if self._settings.routes_given else RESULTS)
        agent, seeds = marker.agent or self._settings.agent, marker.seeds or self._settings.seeds
        return Scope(agent, spec, self.routes(spec), seeds, RESULTS)

    def routes(self, spec: str) -> tuple[Route, ...]:
        """All routes of the results, some of them by id, or those of a route file. Raises `UsageError`."""
        if spec == RESULTS:
            return self._results.routes
        try:
            return self._named([name.strip() for name in spec.split(",")])
        except UnknownNameError:
            return self._load_routes(spec)

    def identify(self, scope: Scope) -> Identified:
        """What is known about an agent that drove elsewhere: its routes."""
        routes = tuple(f"{route.id}={route_digest(route)}" for route in scope.routes)
        return Identified(agent=scope.agent, distribution=RESULTS, source="", weights="", routes=routes)

    def check(self) -> None:
        """Nothing but results is needed, and those were read."""

    def check_setting(self, setting: Setting) -> None:
        """Raise `PerturbationError` for a severity that no tick of Bench2Drive shows."""
        setting.start(route_id="", seed=0, dt_s=_TICK_S, cameras=())

    def check_tasks(self, tasks: Iterable[Task]) -> None:
        """Raise one `UsageError` that names everything that the results do not hold."""
        self._results.check(tasks)

    def _named(self, names: Sequence[str]) -> tuple[Route, ...]:
        by_id = {route.id: route for route in self._results.routes}
        unknown = [name for name in names if name not in by_id]
        if unknown:
            raise UnknownNameError.of("route in the results", unknown[0], by_id)
        return tuple(by_id[name] for name in dict.fromkeys(names))
