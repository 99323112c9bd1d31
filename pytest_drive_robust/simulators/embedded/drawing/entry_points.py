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
from pytest_drive_robust.simulators.embedded.drawing.raster import draw_faces
from pytest_drive_robust.simulators.embedded.drawing.shade import draw_pixels, pack_pixels
from pytest_drive_robust.simulators.embedded.drawing.shadows import draw_shadows
from pytest_drive_robust.simulators.embedded.drawing.street_lamps import draw_pools


@entry
def draw_camera(
    canvas: Canvas,
    scene: FrameScene,
    ground: CameraGround,
    view: CameraView,
    air: Air,
    lamps: Headlamps,
    street_light: float,
    tick: int,
) -> None:
    """Draw the picture of one camera to `canvas.pixels`."""
    draw_faces(canvas, scene.rows, scene.still, scene.ends, scene.actors, view)
    draw_ground(canvas, ground.rows, ground.sky, ground.texels, ground.levels, view, air, lamps)
    draw_shadows(canvas, ground.rows, scene.actors, view, air)
    draw_pixels(canvas, scene.rows, view, air, lamps, ground.clear)
    if street_light > 0.0:
        draw_pools(canvas, scene.street_lamps, view, air.haze_per_m, street_light)
    pack_pixels(canvas.words, canvas.colours)
    if air.rain > 0.0 or air.drops > 0.0 or air.glare > 0.0:
        draw_lens(canvas.pixels, canvas.faces, tick, view, air)


@entry
def find_actors(canvas: Canvas, scene: FrameScene, view: CameraView, instance: Annotated[NDArray[np.int32], 2]) -> None:
    """Write to `instance` (height, width) the actor id that each pixel shows; see `CameraRig.actors_seen`."""
    draw_faces(canvas, scene.rows, scene.still, scene.ends, scene.actors, view)
    for row in range(instance.shape[0]):
        instance[row, :] = -1
        for column in range(canvas.touched[row, 0], canvas.touched[row, 1]):
            number = canvas.faces[row, column]
            if number != 0:
                instance[row, column] = int(scene.rows[int(canvas.table[number, face.BOX]), box.INSTANCE])
