"""The work of `drive-robust routes check` and `draw`, which lay out routes in the embedded world."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from pytest_drive_robust.cli.tables import LEFT, RIGHT, print_table
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import RouteError, UsageError
from pytest_drive_robust.options.parsers import check_seeds
from pytest_drive_robust.report.video import write_png
from pytest_drive_robust.simulators.embedded.route_scene import describe_parameters, describe_road, telling_moment
from pytest_drive_robust.simulators.embedded.route_sheet import draw_tile, lay_sheets
from pytest_drive_robust.simulators.embedded.world import World


def check_routes(spec: str, routes: Sequence[Route]) -> int:
    """Print a row for every route that can be driven; then raise one `RouteError` that names all other routes."""
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
    if rows:
        print_table(
            {"id": RIGHT, "scenario": LEFT, "town": LEFT, "m": RIGHT, "at": RIGHT, "road": LEFT, "the file says": LEFT},
            rows,
            title=f"{spec}: {len(rows)} of {len(routes)} routes can be driven",
        )
    if problems:
        raise RouteError("\n  ".join([f"{len(problems)} of {len(routes)} routes cannot be driven:", *problems]))
    return 0


def draw_routes(options: argparse.Namespace, routes: Callable[[], Sequence[Route]]) -> int:
    """Write contact sheets of routes; call `routes` only after the options are checked. Raises `UsageError`."""
    target = Path(options.output)
    if target.suffix.lower() != ".png":
        raise UsageError(f"--output is {options.output!r}, expected the name of a .png file.")
    check_seeds([options.seed], source="--seed")
    if not 64 <= options.size <= 2048:
        raise UsageError(f"--size is {options.size}, expected 64 to 2048 pixels.")
    if options.columns is not None and options.columns < 1:
        raise UsageError(f"--columns is {options.columns}, expected at least 1.")
    if not target.parent.is_dir():
        raise UsageError(f"--output is {options.output!r}, but there is no folder {str(target.parent)!r}.")
    camera = CameraSpec("front") if options.camera else None
    tiles = [
        draw_tile(telling_moment(route, seed=options.seed), size_px=options.size, camera=camera) for route in routes()
    ]
    for number, sheet in enumerate(lay_sheets(tiles, columns=options.columns or (3 if camera else 8)), start=1):
        path = target if number == 1 else target.with_name(f"{target.stem}-{number}{target.suffix}")
        write_png(path, sheet)
        print(f"{path}: {sheet.shape[1]} x {sheet.shape[0]} pixels")
    return 0
