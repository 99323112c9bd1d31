"""The cameras of the embedded world: pinhole pictures on the CPU, with depth.

First `drawing/raster.py` finds which face of which box each pixel shows; then sky and ground fill what is left
(`drawing/ground.py`), faces are coloured (`drawing/shade.py`), rain falls. Everything is a pure function of map,
weather, camera and state: the kernels run in one thread, no sum is reordered, and OpenCV (whose thread count is global
and stays as it is) only fills polygons of the ground texture, which it does in one thread.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.arithmetic.arrays import exp
from pytest_drive_robust.errors import SimulationError, UnknownNameError
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.boxes import BOX_COLUMNS
from pytest_drive_robust.simulators.embedded.drawing.canvas import Canvas
from pytest_drive_robust.simulators.embedded.drawing.entry_points import (
    CameraGround,
    FrameScene,
    Passes,
    draw_camera,
    fill_boxes,
    measure_camera,
)
from pytest_drive_robust.simulators.embedded.drawing.furniture import Furniture
from pytest_drive_robust.simulators.embedded.drawing.ground import ground_rows
from pytest_drive_robust.simulators.embedded.drawing.looks import LOOKS, PAINTS, part_rows
from pytest_drive_robust.simulators.embedded.drawing.shade import CLEAR_STEPS_PER_M
from pytest_drive_robust.simulators.embedded.drawing.sky import sky_rows
from pytest_drive_robust.simulators.embedded.drawing.texture import GroundTexture, ground_texture
from pytest_drive_robust.simulators.embedded.drawing.view import CameraView, Headlamps
from pytest_drive_robust.simulators.embedded.semantics import KIND_LABELS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.observation import CameraSpec
    from pytest_drive_robust.domain.route import Weather
    from pytest_drive_robust.domain.truth import LaneMap, WorldState

    Pixels = NDArray[np.uint8]
    Measured = NDArray[np.uint8] | NDArray[np.float32] | NDArray[np.int32]

__all__ = ["PASSES", "CameraRig"]

PASSES = ("rgb", "semantic", "depth", "instance")
"""What `CameraRig.render_passes` knows."""

_MOST_PARTS = max(len(parts) for parts in LOOKS.values())
_FARTHEST_M = 512
_NOT_WANTED = Passes(np.zeros((0, 0), np.uint8), np.zeros((0, 0), np.float32), np.zeros((0, 0), np.int32))


@dataclass(slots=True)
class _Eye:
    """One camera with its memory, and what stays the same in all of its pictures."""

    spec: CameraSpec
    canvas: Canvas
    ground: CameraGround
    passes: Passes

    @classmethod
    def of(cls, spec: CameraSpec, air: Air, texture: GroundTexture, clear: NDArray[np.float32]) -> _Eye:
        width, height = spec.width_px, spec.height_px
        view = CameraView.of(spec, 0.0, 0.0, 0.0)
        rows = ground_rows(height, view, air.haze_per_m, texture.levels)
        ground = CameraGround(rows, sky_rows(height, view, air), texture.texels, texture.levels, clear)
        return cls(spec, Canvas.of(width, height), ground, _NOT_WANTED)

    def wanted(self, names: Collection[str]) -> Passes:
        """Return the arrays of the passes `names`; the others are empty."""
        shape = self.canvas.faces.shape
        for name, empty in _NOT_WANTED._asdict().items():
            if name in names and not getattr(self.passes, name).size:
                self.passes = self.passes._replace(**{name: np.zeros(shape, empty.dtype)})
        return Passes(*(getattr(self.passes if name in names else _NOT_WANTED, name) for name in Passes._fields))


class CameraRig:
    """All cameras of one vehicle on one map in one weather.

    `around` (n, 2 or more) holds points of the route in metres: the ground is drawn in detail near them. Raises
    `SimulationError` for cameras that cannot be (no pixels, a field of view outside 0..180 degrees, a name twice).
    """

    def __init__(
        self, lane_map: LaneMap, weather: Weather, cameras: Sequence[CameraSpec], *, around: NDArray[np.float64]
    ) -> None:
        _check(cameras)
        self._air = Air.of(weather)
        self._street_light = self._air.street_light
        self._furniture = Furniture.of(lane_map, night=self._air.night)
        self._parts, self._spans = part_rows()
        self._rows = self._furniture.rows.copy()
        self._ends = np.zeros(1, np.int64)
        texture = ground_texture(lane_map, np.asarray(around, np.float64))
        depths_m = (np.arange(_FARTHEST_M * CLEAR_STEPS_PER_M) + 0.5) / CLEAR_STEPS_PER_M
        clear = exp(-self._air.haze_per_m * depths_m).astype(np.float32)
        self._eyes = tuple(_Eye.of(camera, self._air, texture, clear) for camera in cameras)

    def render(self, state: WorldState, due: Collection[str] | None = None) -> dict[str, Pixels]:
        """Return (height, width, 3) uint8 RGB pictures by the camera's name: of the cameras `due`, or of all.

        The arrays are the rig's own and are drawn over by the next call: copy what must last.
        """
        scene, lamps = self._scene(state), self._headlamps(state)
        pictures: dict[str, Pixels] = {}
        for eye in self._eyes:
            if due is None or eye.spec.name in due:
                self._draw(eye, state, scene, lamps)
                pictures[eye.spec.name] = eye.canvas.pixels
        return pictures

    def render_passes(
        self, state: WorldState, passes: Collection[str] = PASSES, *, due: Collection[str] | None = None
    ) -> dict[str, dict[str, Measured]]:
        """Return what the cameras see, measured on the same geometry: by the camera's name, then by the pass.

        - `"rgb"` (height, width, 3) uint8: as `render`.
        - `"semantic"` (height, width) uint8: a `SemanticClass` each.
        - `"depth"` (height, width) float32: metres along the optical axis, infinity for the sky.
        - `"instance"` (height, width) int32: the actor's id (`WorldState.ID`), -1 for what is no actor.

        The arrays are the rig's own and are drawn over by the next call. Raises `UnknownNameError` for another name.
        """
        for name in passes:
            if name not in PASSES:
                raise UnknownNameError.of("pass", name, PASSES)
        scene, lamps = self._scene(state), self._headlamps(state)
        found: dict[str, dict[str, Measured]] = {}
        for eye in self._eyes:
            if due is None or eye.spec.name in due:
                wanted = eye.wanted(passes)
                view = self._draw(eye, state, scene, lamps, picture="rgb" in passes)
                measure_camera(eye.canvas, scene, eye.ground, view, wanted)
                arrays: dict[str, Measured] = {"rgb": eye.canvas.pixels, **wanted._asdict()}
                found[eye.spec.name] = {name: arrays[name] for name in passes}
        return found

    def _headlamps(self, state: WorldState) -> Headlamps:
        return Headlamps(state.ego.x_m, state.ego.y_m, state.ego.yaw_rad, self._air.night)

    def _scene(self, state: WorldState) -> FrameScene:
        """Return the boxes of all that is there."""
        still = len(self._furniture.rows)
        needed = still + len(state.actors) * _MOST_PARTS
        if needed > len(self._rows):
            self._rows = np.zeros((needed, BOX_COLUMNS), np.float64)
            self._rows[:still] = self._furniture.rows
        if len(state.actors) >= len(self._ends):
            self._ends = np.zeros(len(state.actors) + 1, np.int64)
        self._furniture.show(self._rows, state.lights)
        actors = np.array(state.actors, np.float64)  # kernels are compiled anew for arrays that are read-only
        scene = FrameScene(self._rows, still, self._ends, actors, self._furniture.street_lamps)
        fill_boxes(scene, state.tick, self._air.night, self._parts, self._spans, PAINTS, KIND_LABELS)
        return scene

    def _draw(
        self, eye: _Eye, state: WorldState, scene: FrameScene, lamps: Headlamps, *, picture: bool = True
    ) -> CameraView:
        eye.canvas = eye.canvas.with_room(len(scene.rows))
        view = CameraView.of(eye.spec, state.ego.x_m, state.ego.y_m, state.ego.yaw_rad)
        draw_camera(eye.canvas, scene, eye.ground, view, self._air, lamps, self._street_light, state.tick, picture)
        return view


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
