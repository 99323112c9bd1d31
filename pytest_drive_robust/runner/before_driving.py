"""Questions to worlds and to agents' factories before driving.

A world or a factory may be a user's code: an error in it, or an answer that cannot be used, becomes a `PluginError`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType, TracebackType
from typing import Any

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import PluginError, UsageError
from pytest_drive_robust.registry.agent_factories import check_of
from pytest_drive_robust.runner.cache_key.canonical_text import canonical_text
from pytest_drive_robust.runner.episode.contract import BLAMED, blame
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.simulators.routes import own_routes, routes_for

_OWN = __name__.partition(".")[0]


def check_factory(agent: str, factory: object) -> None:
    """Call the `check` of the agent's factory, if any. Raises `UsageError` when no agent can be made."""
    check = check_of(factory)
    if check is not None:
        with _refusing(f"`check` of the agent {agent!r}", "UsageError where no agent can be made"):
            check()


def routes_of(spec: str, world: Simulator, load: Callable[[str], tuple[Route, ...]] | None = None) -> tuple[Route, ...]:
    """Return the routes of `spec` as `routes_for` does.

    Raises `UsageError` for a bad spec. Raises `PluginError` when a world with its own routes gives no route, two routes
    with one id, an id that `--drive-routes` could not name, or an id or scenario type that is no text.
    """
    if own_routes(world) is None:
        return routes_for(spec, world, load)
    with _refusing(f"`routes` of the simulator {world.name!r}", "routes"):
        routes = tuple(routes_for(spec, world, load))
        ids = [route.id for route in routes]
        types = [route.scenario.type for route in routes]
    for what, given in (*(("id", name) for name in ids), *(("scenario of the type", name) for name in types)):
        if not isinstance(given, str):
            raise PluginError(f"the simulator {world.name!r} gives a route with the {what} {given!r}, expected text.")
    unnamed = next((name for name in ids if not name or "," in name or name != name.strip()), None)
    if unnamed is not None:
        raise PluginError(
            f"the simulator {world.name!r} gives a route with the id {unnamed!r}, which --drive-routes could not name: "
            "expected text without commas and without blanks at its ends."
        )
    twice = sorted({name for name in ids if ids.count(name) > 1})
    if twice:
        raise PluginError(
            f"the simulator {world.name!r} gives two routes with the id {twice[0]!r}, expected each once."
        )
    if not routes:
        raise PluginError(f"the simulator {world.name!r} gives no route for {spec!r}, expected at least one.")
    return routes


def check_route(world: Simulator, route: Route) -> None:
    """Call the world's `check_route`, if any. Raises `UsageError` when the world cannot drive the route."""
    check: Callable[[Route], object] | None = getattr(world, "check_route", None)
    if check is not None:
        with _refusing(f"`check_route` of the simulator {world.name!r}", "RouteError for one that it cannot drive"):
            check(route)


def facts_of(world: Simulator) -> tuple[object, ...]:
    """Return the name, the version and the tick (s) of a world, and its `versions()`. Raises `PluginError`."""
    with _refusing(f"asking the simulator {world.name!r} for its `versions`", "text for text"):
        facts = (world.name, world.version, world.dt_s, dict(world.versions()))
        canonical_text(facts)
    return facts


def sources_of(world: Simulator) -> list[ModuleType]:
    """Return the modules that a world names in `sources`, beside its own. Raises `PluginError`."""
    named: Any = getattr(world, "sources", ())
    try:
        return [import_module(name) for name in named]
    except BLAMED as error:
        told = f"`sources` of the simulator {world.name!r} is {named!r}, expected names of modules that can be imported"
        raise PluginError(f"{told}: {type(error).__name__}: {error}.") from error


@contextmanager
def _refusing(call: str, expected: str) -> Iterator[None]:
    """Raise `PluginError` for an error in the body; let a `UsageError` through, because it is an answer."""
    try:
        yield
    except UsageError:
        raise
    except BLAMED as error:
        raise PluginError(f"{blame(call, error.with_traceback(_below_ours(error)))}, expected {expected}.") from error


def _below_ours(error: BaseException) -> TracebackType | None:
    """Return the traceback from the first line outside this package on: our code only passes the call on."""
    trace = error.__traceback__
    while trace is not None and str(trace.tb_frame.f_globals.get("__name__")).partition(".")[0] == _OWN:
        trace = trace.tb_next
    return trace
