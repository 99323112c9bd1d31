"""`drive-robust routes`: which routes there are, and what happens on them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.domain.route import Route

__all__ = ["add_commands", "print_sets"]

_WIDTH = 100
_SPEC_HELP = "a set (full, one-per-scenario, dev10), a file, ids, or FILE:id,id; default: one-per-scenario"


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `routes list`, `routes check` and `routes draw` to the commands of a parser."""
    routes = commands.add_parser("routes", help="list routes, check that they can be driven, or draw them from above")
    what = routes.add_subparsers(required=True, metavar="WHAT")
    listing = what.add_parser("list", help="id, scenario, town, length and weather of each route")
    listing.set_defaults(command=_list)
    check = what.add_parser("check", help="what was understood of each route, or why it cannot be driven")
    check.set_defaults(command=_check)
    draw = what.add_parser("draw", help="a contact sheet: each route from above when its scenario is on")
    draw.add_argument("-o", "--output", default="routes.png", metavar="FILE.png", help="default: routes.png")
    draw.add_argument("--camera", action="store_true", help="beside each the view of a front camera")
    draw.add_argument("--size", type=int, default=320, metavar="PX", help="side of one picture; default: 320")
    draw.add_argument("--columns", type=int, default=None, metavar="N", help="default: 8, with cameras 3")
    draw.add_argument("--seed", type=int, default=0, help="default: 0")
    draw.set_defaults(command=_draw)
    for command in (listing, check, draw):
        command.add_argument("routes", nargs="?", metavar="SET", help=_SPEC_HELP)
    draw.add_argument("ids", nargs="*", metavar="ID", help="only these of them")


def print_sets() -> None:
    """Every named set with the number of its routes and what it holds."""
    from pytest_drive_robust.simulators.embedded.routes import named_routes, set_names, set_summary

    rows = [(name, str(len(named_routes(name))), set_summary(name)) for name in set_names()]
    _print_table("routes", {"set": "left", "routes": "right", "what it holds": "left"}, rows)
    print("drive-robust routes list SET shows them, drive-robust routes draw SET draws them.")


def _list(options: argparse.Namespace) -> int:
    from pytest_drive_robust.simulators.embedded.weathers import weather_name

    spec, routes = _routes(options)
    columns = {"id": "right", "scenario": "left", "town": "left", "metres": "right", "weather": "left"}
    rows = [
        (route.id, route.scenario.type, route.town, f"{_length_m(route):.0f}", weather_name(route.weather))
        for route in routes
    ]
    _print_table(f"{spec}: {len(routes)} route{'s' * (len(routes) != 1)}", columns, rows)
    return 0


def _check(options: argparse.Namespace) -> int:
    """A row for every route that can be driven; then one error that names all others."""
    from pytest_drive_robust.errors import RouteError

    spec, routes = _routes(options)
    from pytest_drive_robust.simulators.embedded.route_words import describe_parameters, describe_road
    from pytest_drive_robust.simulators.embedded.world import World

    rows: list[tuple[str, ...]] = []
    problems: list[str] = []
    for route in routes:
        try:
            dense = World(route, seed=0).dense
        except UsageError as error:
            problems.append(str(error))
            continue
        rows.append(
            (
                route.id, route.scenario.type, route.town, f"{dense.length_m:.0f}", f"{dense.trigger_m:.0f}",
                describe_road(dense), describe_parameters(route.scenario),
            )
        )  # fmt: skip
    columns = {"id": "right", "scenario": "left", "town": "left", "m": "right", "at": "right"}
    columns |= {"road": "left", "the file says": "left"}
    if rows:
        _print_table(f"{spec}: {len(rows)} of {len(routes)} routes can be driven", columns, rows)
    if problems:
        raise RouteError("\n  ".join([f"{len(problems)} of {len(routes)} routes cannot be driven:", *problems]))
    return 0


def _draw(options: argparse.Namespace) -> int:
    target = Path(options.output)
    if target.suffix.lower() != ".png":
        raise UsageError(f"--output is {options.output!r}, expected the name of a .png file.")
    if not 64 <= options.size <= 2048:
        raise UsageError(f"--size is {options.size}, expected 64 to 2048 pixels.")
    if options.columns is not None and options.columns < 1:
        raise UsageError(f"--columns is {options.columns}, expected at least 1.")
    if not target.parent.is_dir():
        raise UsageError(f"--output is {options.output!r}, but there is no folder {str(target.parent)!r}.")
    _, routes = _routes(options)

    import cv2

    from pytest_drive_robust.domain.observation import CameraSpec
    from pytest_drive_robust.simulators.embedded.route_scene import telling_moment
    from pytest_drive_robust.simulators.embedded.route_sheet import draw_tile, lay_sheets

    camera = CameraSpec("front") if options.camera else None
    tiles = [
        draw_tile(telling_moment(route, seed=options.seed), size_px=options.size, camera=camera) for route in routes
    ]
    for number, sheet in enumerate(lay_sheets(tiles, columns=options.columns or (3 if camera else 8)), start=1):
        path = target if number == 1 else target.with_name(f"{target.stem}-{number}{target.suffix}")
        encoded = cv2.imencode(".png", sheet[:, :, ::-1])[1]
        try:
            path.write_bytes(encoded.tobytes())
        except OSError as error:
            raise UsageError(f"cannot write {str(path)!r}: {error.strerror}") from None
        print(f"{path}: {sheet.shape[1]} x {sheet.shape[0]} pixels")
    return 0


def _routes(options: argparse.Namespace) -> tuple[str, tuple[Route, ...]]:
    from pytest_drive_robust.runner.routes import DEFAULT_ROUTES, resolve_routes

    spec = options.routes or DEFAULT_ROUTES
    ids = getattr(options, "ids", ())
    if ids:
        spec = f"{spec}:{','.join(ids)}"
    return spec, resolve_routes(spec)


def _length_m(route: Route) -> float:
    """Along the waypoints: a file can be listed whose towns we do not know."""
    from itertools import pairwise
    from math import hypot

    return sum(hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(route.waypoints))


def _print_table(title: str, columns: dict[str, str], rows: Sequence[tuple[str, ...]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=None, padding=(0, 2 if len(columns) < 5 else 1, 0, 0))
    for column, justify in columns.items():
        table.add_column(column, justify=justify, overflow="fold")  # type: ignore[arg-type]
    for row in rows:
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else _WIDTH, markup=False, highlight=False).print(table)
