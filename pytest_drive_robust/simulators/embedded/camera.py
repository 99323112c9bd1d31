"""The cameras of the embedded world: pinhole pictures on the CPU, with depth.

Ground and sky come first (`drawing/ground.py`), then shadows, then boxes through a depth buffer (`drawing/raster.py`),
then rain. Everything is a pure function of map, weather, camera and frame: the kernels run in one thread, sample in
integers, and OpenCV (whose thread count is global and stays as it is) only fills polygons of the ground texture, which
it does in one thread.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.assemble import assemble
from pytest_drive_robust.simulators.embedded.drawing.boxes import BOX_COLUMNS
from pytest_drive_robust.simulators.embedded.drawing.furniture import Furniture
from pytest_drive_robust.simulators.embedded.drawing.ground import draw_ground
from pytest_drive_robust.simulators.embedded.drawing.looks import LOOKS, PAINTS, part_rows
from pytest_drive_robust.simulators.embedded.drawing.rain import draw_rain
from pytest_drive_robust.simulators.embedded.drawing.raster import draw_boxes, draw_shadows
from pytest_drive_robust.simulators.embedded.drawing.texture import FAR_COLOUR, ground_texture
from pytest_drive_robust.simulators.embedded.drawing.view import Headlamps, View

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.observation import CameraSpec
    from pytest_drive_robust.domain.route import Weather
    from pytest_drive_robust.domain.truth import Frame, LaneMap

    Pixels = NDArray[np.uint8]

__all__ = ["CameraRig"]

_MOST_PARTS = max(len(parts) for parts in LOOKS.values())
_FAR_PACKED = sum(int(colour) << (8 * channel) for channel, colour in enumerate(FAR_COLOUR))
_FARTHEST_M = 512


class CameraRig:
    """All cameras of one vehicle on one map in one weather.

    `around` (n, 2 or more) holds points of the route in metres: the ground is drawn in detail near them. Raises
    `SimulationError` for cameras that cannot be (no pixels, a field of view outside 0..180 degrees, a name twice).
    """

    def __init__(
        self, lane_map: LaneMap, weather: Weather, cameras: Sequence[CameraSpec], *, around: NDArray[np.float64]
    ) -> None:
        _check(cameras)
        self._cameras = tuple(cameras)
        self._air = Air.of(weather)
        self._clear = np.exp(-self._air.haze_per_m * (np.arange(_FARTHEST_M) + 0.5))
        self._texture = ground_texture(lane_map, np.asarray(around, np.float64))
        self._furniture = Furniture.of(lane_map)
        self._parts, self._spans = part_rows()
        self._rows = self._furniture.rows.copy()
        self._pixels = {c.name: np.zeros((c.height_px, c.width_px, 3), np.uint8) for c in self._cameras}
        self._depth = {c.name: np.zeros((c.height_px, c.width_px), np.float32) for c in self._cameras}

    def render(self, frame: Frame, due: Collection[str] | None = None) -> dict[str, Pixels]:
        """Pictures of `frame`, (height, width, 3) uint8 RGB by the camera's name: of the cameras `due`, or of all.

        The arrays are the rig's own and are drawn over by the next call: copy what must last.
        """
        count = self._fill_rows(frame)
        lamps = Headlamps(frame.ego.x_m, frame.ego.y_m, frame.ego.yaw_rad, self._air.night)
        pictures: dict[str, Pixels] = {}
        for camera in self._cameras:
            if due is None or camera.name in due:
                pictures[camera.name] = self._draw(camera, frame, count, lamps)
        return pictures

    def _fill_rows(self, frame: Frame) -> int:
        """Put the boxes of all that is there into `self._rows`; returns how many there are."""
        still = len(self._furniture.rows)
        needed = still + len(frame.actors) * _MOST_PARTS
        if needed > len(self._rows):
            self._rows = np.zeros((needed, BOX_COLUMNS), np.float64)
            self._rows[:still] = self._furniture.rows
        self._furniture.show(self._rows, frame.lights)
        count: int = assemble(
            self._rows, still, frame.actors, frame.tick, self._air.night, self._parts, self._spans, PAINTS
        )
        return count

    def _draw(self, camera: CameraSpec, frame: Frame, count: int, lamps: Headlamps) -> Pixels:
        image, air = self._pixels[camera.name], self._air
        view = View.of(camera, frame.ego.x_m, frame.ego.y_m, frame.ego.yaw_rad)
        draw_ground(image, self._texture.texels, self._texture.levels, _FAR_PACKED, view, air, lamps)
        draw_shadows(image, frame.actors, view, air.shadow)
        still = len(self._furniture.rows)
        draw_boxes(image, self._depth[camera.name], self._rows, still, count, view, air, lamps, self._clear)
        if air.rain > 0.0:
            draw_rain(image, frame.tick, air.rain)
        return image


def _check(cameras: Sequence[CameraSpec]) -> None:
    names = [camera.name for camera in cameras]
    for camera in cameras:
        if names.count(camera.name) > 1:
            raise SimulationError(
                f"{names.count(camera.name)} cameras are named {camera.name!r}; expected one name each"
            )
        if camera.width_px < 1 or camera.height_px < 1:
            raise SimulationError(
                f"camera {camera.name!r} is {camera.width_px} x {camera.height_px} pixels; expected at least 1 x 1"
            )
        if not 0.0 < camera.fov_deg < 180.0:
            raise SimulationError(
                f"camera {camera.name!r} has a horizontal field of view of {camera.fov_deg!r} degrees; "
                "expected more than 0 and less than 180"
            )
        places = (camera.x_m, camera.y_m, camera.z_m, camera.yaw_deg, camera.pitch_deg)
        if not all(math.isfinite(place) for place in places):
            raise SimulationError(f"camera {camera.name!r} is mounted at {places!r}; expected finite numbers")
