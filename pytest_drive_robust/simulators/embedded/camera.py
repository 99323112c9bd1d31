"""The cameras of the embedded world: pinhole pictures on the CPU, with depth.

First `drawing/raster.py` finds which face of which box each pixel shows. Then sky and ground fill the other pixels
(`drawing/ground.py`), faces are coloured (`drawing/shade.py`), and rain is drawn. A picture is a pure function of map,
weather, camera and state: the kernels run in one thread and no sum is reordered. OpenCV (whose global thread count
stays unchanged) only fills polygons of the ground texture, in one thread.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic.arrays import exp
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.route import Weather
from pytest_drive_robust.domain.truth import LaneMap, WorldState
from pytest_drive_robust.jit.arrays import Floats, Pixels
from pytest_drive_robust.simulators.embedded.drawing.air import Air, sky_rows
from pytest_drive_robust.simulators.embedded.drawing.assemble import assemble
from pytest_drive_robust.simulators.embedded.drawing.boxes import BOX_COLUMNS
from pytest_drive_robust.simulators.embedded.drawing.canvas import (
    CameraGround,
    CameraView,
    Canvas,
    FrameScene,
    Headlamps,
)
from pytest_drive_robust.simulators.embedded.drawing.entry_points import draw_camera, find_actors
from pytest_drive_robust.simulators.embedded.drawing.furniture import Furniture
from pytest_drive_robust.simulators.embedded.drawing.ground import ground_rows
from pytest_drive_robust.simulators.embedded.drawing.looks import LOOKS, PAINTS, part_rows
from pytest_drive_robust.simulators.embedded.drawing.shade import CLEAR_STEPS_PER_M
from pytest_drive_robust.simulators.embedded.drawing.texture import GroundTexture, ground_texture

_MOST_PARTS = max(len(parts) for parts in LOOKS.values())
_FARTHEST_M = 512


class _Eye:
    """One camera with its canvas, and the data that all of its pictures share."""

    def __init__(self, spec: CameraSpec, air: Air, texture: GroundTexture, clear: NDArray[np.float32]) -> None:
        self.spec = spec
        self._canvas = Canvas.of(spec.width_px, spec.height_px)
        view = CameraView.of(spec, 0.0, 0.0, 0.0)
        rows = ground_rows(spec.height_px, view, air.haze_per_m, texture.levels)
        self.ground = CameraGround(rows, sky_rows(spec.height_px, view, air), texture.texels, texture.levels, clear)

    def canvas(self, scene: FrameScene) -> Canvas:
        """Return the camera's canvas, with room for all boxes of a scene."""
        self._canvas = self._canvas.with_room(len(scene.rows))
        return self._canvas

    def view(self, state: WorldState) -> CameraView:
        """Return the camera's position and orientation in the world."""
        return CameraView.of(self.spec, state.ego.x_m, state.ego.y_m, state.ego.yaw_rad)


class CameraRig:
    """All cameras of one vehicle on one map in one weather.

    `around` (n, 2 or more) holds points of the route in metres: the ground is drawn in detail near them.
    """

    def __init__(self, lane_map: LaneMap, weather: Weather, cameras: Sequence[CameraSpec], *, around: Floats) -> None:
        self._air = Air.of(weather)
        self._furniture = Furniture.of(lane_map, night=self._air.night)
        self._parts, self._spans = part_rows()
        self._rows = self._furniture.rows.copy()
        self._ends = np.zeros(1, np.int64)
        texture = ground_texture(lane_map, np.asarray(around, np.float64))
        depths_m = (np.arange(_FARTHEST_M * CLEAR_STEPS_PER_M) + 0.5) / CLEAR_STEPS_PER_M
        clear = exp(-self._air.haze_per_m * depths_m).astype(np.float32)
        self._eyes = tuple(_Eye(camera, self._air, texture, clear) for camera in cameras)

    def render(self, state: WorldState, due: Collection[str] | None = None) -> dict[str, Pixels]:
        """Return (height, width, 3) uint8 RGB pictures by camera name, of the cameras in `due` (None: of all).

        The next call draws over these arrays: copy an array that must last.
        """
        scene, ego = self._scene(state), state.ego
        lamps = Headlamps(ego.x_m, ego.y_m, ego.yaw_rad, self._air.night)
        pictures: dict[str, Pixels] = {}
        for eye in self._eyes:
            if due is None or eye.spec.name in due:
                canvas, view = eye.canvas(scene), eye.view(state)
                draw_camera(canvas, scene, eye.ground, view, self._air, lamps, state.tick)
                pictures[eye.spec.name] = canvas.pixels
        return pictures

    def actors_seen(self, state: WorldState) -> dict[str, NDArray[np.int32]]:
        """Return (height, width) by the camera's name: the id of the actor that each pixel shows, -1 for none."""
        scene = self._scene(state)
        found: dict[str, NDArray[np.int32]] = {}
        for eye in self._eyes:
            seen = found[eye.spec.name] = np.empty((eye.spec.height_px, eye.spec.width_px), np.int32)
            find_actors(eye.canvas(scene), scene, eye.view(state), seen)
        return found

    def _scene(self, state: WorldState) -> FrameScene:
        """Return the boxes of everything in the world at this moment."""
        still = len(self._furniture.rows)
        needed = still + len(state.actors) * _MOST_PARTS
        if needed > len(self._rows):
            self._rows = np.zeros((needed, BOX_COLUMNS), np.float64)
            self._rows[:still] = self._furniture.rows
        if len(state.actors) >= len(self._ends):
            self._ends = np.zeros(len(state.actors) + 1, np.int64)
        self._furniture.show(self._rows, state.lights)
        actors = np.array(state.actors, np.float64)  # kernels are compiled anew for arrays that are read-only
        night = self._air.night
        assemble(self._rows, self._ends, still, actors, state.tick, night, self._parts, self._spans, PAINTS)
        return FrameScene(self._rows, still, self._ends, actors, self._furniture.street_lamps)
