"""`drive-robust routes`: which routes there are, and what happens on them."""

from __future__ import annotations

import argparse
from itertools import pairwise
from math import hypot

from pytest_drive_robust.cli.pytest_options import add_pytest_option
from pytest_drive_robust.cli.tables import LEFT, RIGHT, print_table
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.options.run import DEFAULT_ROUTES, DEFAULT_SIMULATOR
from pytest_drive_robust.report.numbers import counted
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded.route_sets import named_routes, set_names, set_summary
from pytest_drive_robust.simulators.embedded.weathers import weather_name
from pytest_drive_robust.simulators.routes import default_spec, resolve_routes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `routes list`, `routes check` and `routes draw`."""
    what = parser.add_subparsers(required=True, metavar="WHAT")
    listing = what.add_parser("list", help="list id, scenario, town, length and weather of each route")
    add_pytest_option(listing, "--sim")
    listing.set_defaults(command=_list)
    check = what.add_parser("check", help="tell what was understood of each route, or why it cannot be driven")
    check.set_defaults(command=_check)
    draw = what.add_parser("draw", help="draw one sheet of pictures: each route from above while its scenario happens")
    draw.add_argument(
        "-o", "--output", default="routes.png", metavar="FILE.png", help="write this file; default: routes.png"
    )
    draw.add_argument("--camera", action="store_true", help="also show what a front camera sees there")
    draw.add_argument("--size", type=int, default=320, metavar="PX", help="side of one picture in pixels; default: 320")
    draw.add_argument(
        "--columns", type=int, default=None, metavar="N", help="pictures in a row; default: 8, with --camera 3"
    )
    draw.add_argument("--seed", type=int, default=0, help="seed of the traffic; default: 0")
    draw.set_defaults(command=_draw)
    text = f"a set (full, one-per-scenario, dev10), a file, ids, or FILE:id,id; default: {DEFAULT_ROUTES}"
    for command in (listing, check, draw):
        command.add_argument("routes", nargs="?", default=DEFAULT_ROUTES, metavar="SET", help=text)
    listing.set_defaults(routes=None)  # another world may have other routes
    draw.add_argument("ids", nargs="*", metavar="ID", help="draw only these routes of SET; default: all")


def print_sets() -> None:
    """Print every named set with the number of its routes and what it holds."""
    rows = [(name, str(len(named_routes(name))), set_summary(name)) for name in set_names()]
    print_table({"set": LEFT, "routes": RIGHT, "what it holds": LEFT}, rows, title="routes")
    print("drive-robust routes list SET shows them, drive-robust routes draw SET draws them.")


def _list(options: argparse.Namespace) -> int:
    spec, routes = _routes_of_world(options)
    rows = [
        (route.id, route.scenario.type, route.town, _length(route), weather_name(route.weather)) for route in routes
    ]
    print_table(
        {"id": RIGHT, "scenario": LEFT, "town": LEFT, "metres": RIGHT, "weather": LEFT},
        rows,
        title=f"{spec}: {counted(len(routes), 'route')}",
    )
    return 0


def _check(options: argparse.Namespace) -> int:
    from pytest_drive_robust.cli.route_inspection import check_routes  # the embedded world takes a second to import

    spec, routes = _routes(options)
    return check_routes(spec, routes)


def _draw(options: argparse.Namespace) -> int:
    from pytest_drive_robust.cli.route_inspection import draw_routes

    return draw_routes(options, lambda: _routes(options)[1])


def _routes(options: argparse.Namespace) -> tuple[str, tuple[Route, ...]]:
    spec: str = options.routes
    ids = getattr(options, "ids", ())
    if ids:
        spec = f"{spec}:{','.join(ids)}"
    return spec, resolve_routes(spec)


def _routes_of_world(options: argparse.Namespace) -> tuple[str, tuple[Route, ...]]:
    """Return the specification and the routes that a run in the simulator `--sim` has, perhaps of its own."""
    asked = DEFAULT_ROUTES if options.routes is None else options.routes
    if options.sim == DEFAULT_SIMULATOR:
        return asked, resolve_routes(asked)
    from pytest_drive_robust.registry.registry import default_registry
    from pytest_drive_robust.runner.before_driving import routes_of

    world = default_registry().simulator(options.sim, SimulatorOptions())
    try:
        spec = default_spec(asked, world, given=options.routes is not None)
        return spec, routes_of(spec, world)
    finally:
        world.close()


def _length(route: Route) -> str:
    """Return the metres along the waypoints, `"-"` without waypoints. Needs no map, so unknown towns can be listed."""
    if len(route.waypoints) < 2:
        return "-"
    return f"{sum(hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(route.waypoints)):.0f}"
