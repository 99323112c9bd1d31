"""What stands where around the ego, as classes seen from above: for privileged agents and for training."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.embedded.drawing.entry import look_down
from pytest_drive_robust.simulators.embedded.drawing.texture import ground_texture
from pytest_drive_robust.simulators.embedded.drawing.view import View
from pytest_drive_robust.simulators.embedded.semantics import KIND_LABELS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.truth import LaneMap, WorldState

__all__ = ["SemanticBev"]


class SemanticBev:
    """Bird's-eye views of one map, classes by `SemanticClass`, on the same ground as the cameras'.

    A view is a square of `size_px` x `size_px` pixels of `metres_per_pixel`, the ego's heading up: the middle of the
    ego is in the middle of the columns and `ahead_m` below the upper edge (None: three quarters of the view). The ego
    itself is not drawn. `around` (n, 2 or more) holds points of the route, as for `CameraRig`.

    Lanes, lines, grass and buildings are the map's; a stop line is `TRAFFIC_LIGHT` while its light is yellow or red,
    `TRAFFIC_SIGN` where there is a stop sign, and `ROAD_LINE` else. Every actor is at least one pixel. Raises
    `SimulationError` for a view without pixels or metres.
    """

    def __init__(
        self,
        lane_map: LaneMap,
        *,
        around: NDArray[np.float64],
        size_px: int = 192,
        metres_per_pixel: float = 0.25,
        ahead_m: float | None = None,
    ) -> None:
        if size_px < 1 or not 0.0 < metres_per_pixel < math.inf:
            raise SimulationError(
                f"a view from above of {size_px!r} pixels with {metres_per_pixel!r} metres each shows nothing; "
                "expected at least 1 pixel and more than 0 metres"
            )
        self._metres_per_pixel = metres_per_pixel
        self._ahead_m = 0.75 * size_px * metres_per_pixel if ahead_m is None else ahead_m
        self._texture = ground_texture(lane_map, np.asarray(around, np.float64))
        finest_m = float(self._texture.levels[0, 5])
        level = round(math.log2(max(metres_per_pixel / finest_m, 1.0)))
        self._level = min(level, len(self._texture.levels) - 1)
        self._buildings = np.ascontiguousarray(lane_map.buildings, np.float64).reshape(-1, 6)
        lines = [(line.x_m, line.y_m, line.heading_rad, line.width_m) for line in lane_map.stop_lines]
        self._stop_lines = np.array(lines, np.float64).reshape(-1, 4)
        self._classes = np.zeros((size_px, size_px), np.uint8)

    def render(self, frame: WorldState) -> NDArray[np.uint8]:
        """The view of `frame`, (size_px, size_px) uint8, a `SemanticClass` each; drawn over by the next call."""
        ego = frame.ego
        c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
        look_down(
            self._classes,
            self._texture.texels,
            self._texture.levels,
            self._level,
            View(ego.x_m, ego.y_m, 0.0, ego.yaw_rad, 0.0, 1.0, c, s, 1.0, 0.0),
            self._metres_per_pixel,
            self._ahead_m,
            self._buildings,
            self._stop_lines,
            np.array(frame.lights, np.int64),  # copies: kernels are compiled anew for arrays that are read-only
            np.array(frame.actors, np.float64),
            KIND_LABELS,
        )
        return self._classes
