"""The compiled entry points: boxes of a frame once, then everything that one camera shows in one call."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.jit.arrays import Bytes2, Floats2, Ints1, Ints2, Packed1
from pytest_drive_robust.jit.kernels import entry
from pytest_drive_robust.simulators.embedded.drawing.air import Air
from pytest_drive_robust.simulators.embedded.drawing.assemble import assemble
from pytest_drive_robust.simulators.embedded.drawing.canvas import Canvas
from pytest_drive_robust.simulators.embedded.drawing.ground import draw_ground
from pytest_drive_robust.simulators.embedded.drawing.lens import draw_lens
from pytest_drive_robust.simulators.embedded.drawing.passes import measure
from pytest_drive_robust.simulators.embedded.drawing.raster import draw_faces
from pytest_drive_robust.simulators.embedded.drawing.shade import draw_pixels, pack_pixels
from pytest_drive_robust.simulators.embedded.drawing.shadows import draw_shadows
from pytest_drive_robust.simulators.embedded.drawing.street_lamps import draw_pools
from pytest_drive_robust.simulators.embedded.drawing.view import CameraView, Headlamps

__all__ = ["CameraGround", "FrameScene", "Passes", "draw_camera", "fill_boxes", "measure_camera"]


class FrameScene(NamedTuple):
    """What stands and moves in a frame.

    `rows` (n, BOX_COLUMNS) are boxes: up to `still` those that never move, then those of `actors` (k, 10), of which
    actor i has the rows from `ends[i]` up to `ends[i + 1]`. `street_lamps` (m, 3) are the `lamp_places`.
    """

    rows: Floats2
    still: int
    ends: Ints1
    actors: Floats2
    street_lamps: Floats2


class CameraGround(NamedTuple):
    """What never changes for one camera on one map in one weather.

    `rows` is from `ground_rows`, `sky` from `sky_rows`; `texels` and `levels` are a `GroundTexture`; `clear` (n,) is
    the share of a colour that the air lets through, by steps of depth (see `shade.py`).
    """

    rows: Floats2
    sky: Packed1
    texels: Packed1
    levels: Floats2
    clear: Annotated[NDArray[np.float32], 1]


class Passes(NamedTuple):
    """Where the passes go, each (height, width) or (0, 0) when it is not wanted; see `CameraRig.render_passes`."""

    semantic: Bytes2
    depth: Annotated[NDArray[np.float32], 2]
    instance: Annotated[NDArray[np.int32], 2]


@entry
def fill_boxes(
    scene: FrameScene, tick: int, night: float, parts: Floats2, spans: Ints2, paints: Floats2, labels: Ints1
) -> int:
    """Put the boxes of the actors into `scene.rows` (`assemble`); return the row after the last one."""
    return assemble(scene.rows, scene.ends, scene.still, scene.actors, tick, night, parts, spans, paints, labels)


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
    picture: bool,
) -> None:
    """Find what one camera sees and, when `picture`, draw it: `canvas.pixels`."""
    draw_faces(canvas, scene.rows, scene.still, scene.ends, scene.actors, view)
    if not picture:
        return
    draw_ground(canvas, ground.rows, ground.sky, ground.texels, ground.levels, view, air, lamps)
    draw_shadows(canvas, ground.rows, scene.actors, view, air)
    draw_pixels(canvas, scene.rows, view, air, lamps, ground.clear)
    if street_light > 0.0:
        draw_pools(canvas, scene.street_lamps, view, air.haze_per_m, street_light)
    pack_pixels(canvas.words, canvas.colours)
    if air.rain > 0.0 or air.drops > 0.0 or air.glare > 0.0:
        draw_lens(canvas.pixels, canvas.faces, tick, view, air)


@entry
def measure_camera(canvas: Canvas, scene: FrameScene, ground: CameraGround, view: CameraView, passes: Passes) -> None:
    """Fill those of `passes` that have room with what `draw_camera` has found (`passes.measure`)."""
    measure(
        canvas, scene.rows, ground.rows, ground.texels, ground.levels, view,
        passes.semantic, passes.depth, passes.instance,
    )  # fmt: skip
