"""What worlds and the factories of agents are asked before anything is driven.

Their code may be anybody's: what it raises there, and an answer that nothing could be driven with, is a `PluginError`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType, TracebackType
from typing import Any

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import PluginError, UsageError
from pytest_drive_robust.registry.entries import check_of
from pytest_drive_robust.runner.cache_key.canonical_text import canonical_text
from pytest_drive_robust.runner.episode.contract import BLAMED, blame
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.simulators.routes import own_routes, routes_for

_OWN = __name__.partition(".")[0]


def check_factory(agent: str, factory: object) -> None:
    """Call the `check` of the factory of `agent`, where it has one. Raises `UsageError` for what is wrong."""
    check = check_of(factory)
    if check is not None:
        with _refusing(f"`check` of the agent {agent!r}", "UsageError where no agent can be made"):
            check()


def routes_of(spec: str, world: Simulator, load: Callable[[str], tuple[Route, ...]] | None = None) -> tuple[Route, ...]:
    """Return routes as `routes_for` does, of a world's own each once and at least one. Raises `UsageError`."""
    if own_routes(world) is None:
        return routes_for(spec, world, load)
    with _refusing(f"`routes` of the simulator {world.name!r}", "routes"):
        routes = tuple(routes_for(spec, world, load))
        ids = [route.id for route in routes]
        types = [route.scenario.type for route in routes]
    for what, given in (*(("id", name) for name in ids), *(("scenario of the type", name) for name in types)):
        if not isinstance(given, str):
            raise PluginError(f"the simulator {world.name!r} gives a route with the {what} {given!r}, expected text.")
    twice = sorted({name for name in ids if ids.count(name) > 1})
    if twice:
        raise PluginError(
            f"the simulator {world.name!r} gives two routes with the id {twice[0]!r}, expected each once."
        )
    if not routes:
        raise PluginError(f"the simulator {world.name!r} gives no route for {spec!r}, expected at least one.")
    return routes


def check_route(world: Simulator, route: Route) -> None:
    """Let a world say whether it can drive a route. Raises `UsageError` where it cannot."""
    check: Callable[[Route], object] | None = getattr(world, "check_route", None)
    if check is not None:
        with _refusing(f"`check_route` of the simulator {world.name!r}", "RouteError for one that it cannot drive"):
            check(route)


def facts_of(world: Simulator) -> tuple[object, ...]:
    """Return name, version and tick of a world, and what it says to decide its numbers. Raises `PluginError`."""
    with _refusing(f"asking the simulator {world.name!r} for its `versions`", "text for text"):
        facts = (world.name, world.version, world.dt_s, dict(world.versions()))
        canonical_text(facts)
    return facts


def sources_of(world: Simulator) -> list[ModuleType]:
    """Return the modules beside its own that a world says to be made of. Raises `PluginError`."""
    named: Any = getattr(world, "sources", ())
    try:
        return [import_module(name) for name in named]
    except BLAMED as error:
        told = f"`sources` of the simulator {world.name!r} is {named!r}, expected names of modules that can be imported"
        raise PluginError(f"{told}: {type(error).__name__}: {error}.") from error


@contextmanager
def _refusing(call: str, expected: str) -> Iterator[None]:
    """Raise `PluginError` for what somebody's code raises, but for a `UsageError`: that is an answer."""
    try:
        yield
    except UsageError:
        raise
    except BLAMED as error:
        raise PluginError(f"{blame(call, error.with_traceback(_below_ours(error)))}, expected {expected}.") from error


def _below_ours(error: BaseException) -> TracebackType | None:
    """Return the traceback from the first line of somebody's code on: ours only passes the call on."""
    trace = error.__traceback__
    while trace is not None and str(trace.tb_frame.f_globals.get("__name__")).partition(".")[0] == _OWN:
        trace = trace.tb_next
    return trace
