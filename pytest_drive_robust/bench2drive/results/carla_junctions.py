"""Find the first junction of a route, with the maps and the route planner of the user's own CARLA.

Only one rule of the official ability tool (Bench2Drive `tools/ability_benchmark.py`) needs this: a failed route counts
for Traffic_Signs when the car came 8 waypoints beyond the first junction. The `carla` package and CARLA's
`PythonAPI/carla/agents` must be importable, as for the official tool; no server is needed.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

from pytest_drive_robust.bench2drive.results.safe_json import printable
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError

_MAPS = ("CarlaUE4", "Content", "Carla", "Maps")
_BEYOND_WAYPOINTS = 8
_STEP_M = 1.0


def junction_shares(routes: Iterable[Route], carla_root: Path) -> dict[str, float]:
    """Return the share of each route (0..1, or above 1) after which its first junction is passed, by route id.

    Raises `UsageError` when CARLA's packages or a town's map are not there, or when a route has no junction: the
    official tool stops there, too.
    """
    carla, planner_module = _package("carla"), _package("agents.navigation.global_route_planner")
    planners: dict[str, Any] = {}
    shares = {}
    for route in routes:
        if route.town not in planners:
            planners[route.town] = _planner(carla, planner_module, route.town, carla_root)
        shares[route.id] = _share(carla, planners[route.town], route)
    return shares


def _package(name: str) -> Any:
    """Import a module by name, because no other module here needs CARLA. Raises `UsageError` when it is not there."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise UsageError(
            f"--carla-root needs {name!r}, which cannot be imported ({error}). Install the wheel of your CARLA and put "
            "its PythonAPI/carla on PYTHONPATH."
        ) from None


def _planner(carla: Any, planner_module: Any, town: str, carla_root: Path) -> Any:
    maps = carla_root.joinpath(*_MAPS)
    places = [maps / "OpenDrive" / f"{town}.xodr", maps / town / "OpenDrive" / f"{town}.xodr"]
    path = next((place for place in places if place.is_file()), None)
    if path is None:
        raise UsageError(f"there is no map of {printable(town)}: looked for {' and '.join(map(str, places))}.")
    try:
        return planner_module.GlobalRoutePlanner(carla.Map(town, path.read_text(encoding="utf-8")), _STEP_M)
    except (OSError, RuntimeError, UnicodeError) as error:
        raise UsageError(f"the map {str(path)!r} cannot be used: {error}.") from None


def _share(carla: Any, planner: Any, route: Route) -> float:
    places = [carla.Location(point.x_m, point.y_m, point.z_m) for point in route.waypoints]
    in_junction = [
        waypoint.is_junction for begin, end in pairwise(places) for waypoint, _ in planner.trace_route(begin, end)
    ]
    if True not in in_junction:
        raise UsageError(f"the route {printable(route.id)} has no junction: the official ability tool stops at it too.")
    return (in_junction.index(True) + 1 + _BEYOND_WAYPOINTS) / len(in_junction)
