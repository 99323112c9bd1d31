"""Resolve the text of `--drive-routes` to routes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.simulators.embedded.route_sets import ALL_ROUTES, named_routes, set_names
from pytest_drive_robust.simulators.embedded.route_xml import load_routes

if TYPE_CHECKING:
    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.simulators.base import Simulator

    OwnRoutes = Callable[[Sequence[str]], tuple[Route, ...]]


def own_routes(simulator: Simulator) -> OwnRoutes | None:
    """Return the `routes` method of a simulator that cannot drive our routes; None for every other simulator."""
    return getattr(simulator, "routes", None)


def default_spec(spec: str, simulator: Simulator, *, given: bool) -> str:
    """Return `spec`; if not `given` and the simulator has routes of its own, its name, which means all of these."""
    return spec if given or own_routes(simulator) is None else simulator.name


def routes_for(
    spec: str, simulator: Simulator, load: Callable[[str], tuple[Route, ...]] | None = None
) -> tuple[Route, ...]:
    """Return the routes of a specification for a simulator that may have routes of its own, which are looked up first.

    `gymnasium:merge-v0` names all routes of that simulator, `merge-v0-3,merge-v0-12` some of its routes. Sets and files
    work too; the simulator's `check_route` decides whether it can drive their routes. `load` replaces `resolve_routes`.
    Raises the errors of `resolve_routes`.
    """
    load = load or resolve_routes
    own = own_routes(simulator)
    if own is None:
        return load(spec)
    if spec.strip() == simulator.name:
        return own(())
    try:
        return own([name.strip() for name in spec.split(",")])
    except UnknownNameError as unknown:
        try:
            return load(spec)
        except UnknownNameError:
            raise unknown from None


def resolve_routes(spec: str) -> tuple[Route, ...]:
    """Return the routes of a specification, in the order in which it names them.

    ==================== =======================================================
    `one-per-scenario`   a named set: `full`, `one-per-scenario` or `dev10`
    `my/routes.xml`      every route of a file in the leaderboard's schema
    `101,2301`           routes by their ids, out of all that we ship (`full`)
    `dev10:501`          routes of a named set by their ids
    `routes.xml:2091`    routes of a file by their ids
    ==================== =======================================================

    Raises `UnknownNameError` for sets, files and ids that do not exist, `RouteError` for files that we do not
    understand, `UsageError` for an empty specification.
    """
    text = spec.strip()
    if not text:
        raise UsageError("no routes were named: give a set (one-per-scenario), a file (routes.xml) or ids (101,2301).")
    source, ids = _split(text)
    routes = _load(source)
    return routes if ids is None else _select(routes, ids, source)


def ships(spec: str) -> bool:
    """Return whether a specification names routes that we ship, so that their ids identify the routes."""
    return _split(spec.strip())[0] in set_names()


def _split(text: str) -> tuple[str, str | None]:
    """Return (set or file, ids or None); a colon may also belong to a file name (`C:/routes.xml`)."""
    if text in set_names() or _is_file(text):
        return text, None
    source, colon, ids = text.rpartition(":")
    if colon and "/" not in ids and not ids.endswith(".xml"):
        return source.strip(), ids
    if all(part.strip().isdigit() for part in text.split(",") if part.strip()):
        return ALL_ROUTES, text
    return text, None


def _load(source: str) -> tuple[Route, ...]:
    names = set_names()
    if source in names:
        return named_routes(source)
    if _is_file(source):
        return load_routes(Path(source))
    if source.endswith(".xml") or "/" in source:
        folder = Path(source).parent
        beside = [str(path) for path in folder.glob("*.xml")]
        raise UnknownNameError.of("route file", source, beside, hint=f"Looked from the folder {Path.cwd()}.")
    raise UnknownNameError.of("set of routes", source, names, hint="Or give a route file or ids, such as 101,2301.")


def _select(routes: tuple[Route, ...], ids: str, source: str) -> tuple[Route, ...]:
    by_id = {route.id: route for route in routes}
    wanted = [part.strip() for part in ids.split(",") if part.strip()]
    if not wanted:
        raise UsageError(f"no route ids after {source!r}: give them as {source}:{','.join(list(by_id)[:2])}.")
    for name in wanted:
        if name not in by_id:
            hint = f"`drive-robust routes list {source}` shows them."
            raise UnknownNameError.of(f"route of {source!r}", name, by_id, hint=hint)
    return tuple(by_id[name] for name in dict.fromkeys(wanted))


def _is_file(text: str) -> bool:
    try:
        return Path(text).is_file()
    except (OSError, ValueError):  # too long for a file name, as a list of 200 ids is; a NUL
        return False
