"""The compiled entry points: draw one camera's whole picture in one call, or find the actors that the camera sees."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.kernels import entry
from pytest_drive_robust.simulators.embedded.drawing import boxes as box
from pytest_drive_robust.simulators.embedded.drawing import canvas as face
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.canvas import (
    CameraGround,
    CameraView,
    Canvas,
    FrameScene,
    Headlamps,
)
from pytest_drive_robust.simulators.embedded.drawing.ground import draw_ground
from pytest_drive_robust.simulators.embedded.drawing.lens import draw_lens
from pytest_drive_robust.simulators.embedded.drawing.packed import pack_pixels
from pytest_drive_robust.simulators.embedded.drawing.raster import draw_faces
from pytest_drive_robust.simulators.embedded.drawing.shade import draw_pixels
from pytest_drive_robust.simulators.embedded.drawing.shadows import draw_shadows
from pytest_drive_robust.simulators.embedded.drawing.street_lamps import draw_pools

_HALF_DARK = 0.5
"""`Air.night` beyond which street lamps light the road."""


@entry
def draw_camera(
    canvas: Canvas,
    scene: FrameScene,
    ground: CameraGround,
    view: CameraView,
    air: Air,
    lamps: Headlamps,
    tick: int,
) -> None:
    """Draw the picture of one camera to `canvas.pixels`."""
    draw_faces(canvas, scene, view)
    draw_ground(canvas, ground, view, air, lamps)
    draw_shadows(canvas, ground.rows, scene.actors, view, air)
    draw_pixels(canvas, scene.rows, view, air, lamps, ground.clear)
    if air.night > _HALF_DARK:
        draw_pools(canvas, scene.street_lamps, view, air.haze_per_m, air.night)
    pack_pixels(canvas.words, canvas.colours)
    draw_lens(canvas.pixels, canvas.faces, tick, view, air)


@entry
def find_actors(canvas: Canvas, scene: FrameScene, view: CameraView, instance: Annotated[NDArray[np.int32], 2]) -> None:
    """Write to `instance` (height, width) the actor id that each pixel shows; see `CameraRig.actors_seen`."""
    draw_faces(canvas, scene, view)
    for row in range(instance.shape[0]):
        instance[row, :] = -1
        for column in range(canvas.touched[row, 0], canvas.touched[row, 1]):
            number = canvas.faces[row, column]
            if number != 0:
                instance[row, column] = int(scene.rows[int(canvas.table[number, face.BOX]), box.INSTANCE])
