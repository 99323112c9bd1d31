"""The static world of a route as plain data in whole centimetres, on which replays are drawn."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import GroundTruth, Lane
from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.simulators.routes import own_routes

_MARGIN_M = 90.0
_TOLERANCE_M = 0.05
_LINES = {"none": 0, "striped": 1, "solid": 2}


class RoadMaps:
    """Builds the worlds of routes again as driven, and keeps them; without a `simulator` there are none."""

    def __init__(self, simulator: Simulator | None) -> None:
        self._simulator = simulator
        self._truths: dict[tuple[str, int], GroundTruth | None] = {}
        # a simulator with its own routes builds the roads from route and seed
        self._by_seed = simulator is not None and own_routes(simulator) is not None

    def truth(self, route: Route | None, seed: int) -> GroundTruth | None:
        """Return the world of a route at its start, or None when it cannot be built."""
        if route is None or self._simulator is None:
            return None
        name = (route.id, seed if self._by_seed else 0)
        if name not in self._truths:
            self._truths[name] = self._built(route, seed)
        return self._truths[name]

    def close(self) -> None:
        """Free the simulator."""
        if self._simulator is not None:
            self._simulator.close()

    def _built(self, route: Route, seed: int) -> GroundTruth | None:
        assert self._simulator is not None
        try:
            self._simulator.reset(route, seed=seed, cameras=())
            return self._simulator.truth()
        except (DriveRobustError, ArithmeticError, LookupError, TypeError, ValueError):
            return None  # the replay then says that the road is missing


def map_data(truth: GroundTruth) -> dict[str, Any]:
    """Return the route and the lanes, lines and buildings near it as plain JSON types, in cm and mrad."""
    lane_map, route = truth.lane_map, truth.route
    low, high = route[:, :2].min(axis=0) - _MARGIN_M, route[:, :2].max(axis=0) + _MARGIN_M

    def near(points: Floats) -> bool:
        return bool(((points >= low) & (points <= high)).all(axis=1).any())

    return {
        "name": lane_map.name,
        "ego": [_cm(truth.state.ego.length_m), _cm(truth.state.ego.width_m)],
        "route": _line(route[:, :2]),
        "lanes": [_lane(lane) for lane in lane_map.lanes if near(lane.centre[:, :2])],
        "stops": [
            [
                *(_cm(s.x_m), _cm(s.y_m), _mrad(s.heading_rad), _cm(s.width_m)),
                *(int(s.is_light), _cm(s.pole_x_m), _cm(s.pole_y_m)),
            ]
            for s in lane_map.stop_lines
        ],
        "crossings": [_flat(corners) for corners in lane_map.crosswalks if near(corners)],
        "buildings": [
            [_cm(b[0]), _cm(b[1]), _mrad(b[2]), _cm(b[3]), _cm(b[4])] for b in lane_map.buildings if near(b[None, :2])
        ],
    }


def _lane(lane: Lane) -> list[Any]:
    lines = [_LINES.get(lane.left_line, 0), _LINES.get(lane.right_line, 0)]
    return [int(lane.kind), int(lane.junction), _cm(lane.width_m), *lines, _line(lane.centre[:, :2])]


def _line(points: Floats) -> list[int]:
    """Return x, y, x, y, ... in cm, without points that lie within 5 cm of the line through the other points."""
    import cv2

    if len(points) < 3:
        return _flat(points)
    origin = points[0]  # float32 keeps millimetres near 0 only
    kept = cv2.approxPolyDP((points - origin).astype(np.float32).reshape(-1, 1, 2), _TOLERANCE_M, False)
    return _flat(kept.reshape(-1, 2).astype(np.float64) + origin)


def _flat(points: Iterable[Iterable[float]]) -> list[int]:
    return [_cm(value) for point in points for value in point]


def _cm(metres: float) -> int:
    return round(float(metres) * 100.0)


def _mrad(radians: float) -> int:
    return round(float(radians) * 1000.0)
