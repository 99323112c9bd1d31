"""What a camera measures instead of colours: the class, the distance and the actor in each pixel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.drawing import boxes as box
from pytest_drive_robust.simulators.embedded.drawing import canvas as face
from pytest_drive_robust.simulators.embedded.drawing.ground import AHEAD, DEPTH, LEVEL
from pytest_drive_robust.simulators.embedded.drawing.sampling import line_classes
from pytest_drive_robust.simulators.embedded.semantics import SemanticClass

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pytest_drive_robust.simulators.embedded.drawing.canvas import Canvas
    from pytest_drive_robust.simulators.embedded.drawing.view import CameraView

    Floats = NDArray[np.float64]

__all__ = ["measure"]

_SKY = int(SemanticClass.SKY)


@inner
def measure(
    canvas: Canvas,
    rows: Floats,
    ground: Floats,
    texels: NDArray[np.uint32],
    levels: Floats,
    view: CameraView,
    semantic: NDArray[np.uint8],
    depth: NDArray[np.float32],
    instance: NDArray[np.int32],
) -> None:
    """Fill each of `semantic`, `depth` and `instance` that is as large as the picture (the others have no rows)."""
    faces, nearness, table = canvas.faces, canvas.nearness, canvas.table
    height = faces.shape[0]
    if semantic.shape[0] > 0:
        for row in range(height):
            if ground[row, DEPTH] > 0.0:
                depth_m, ahead_m = ground[row, DEPTH], ground[row, AHEAD]
                line_classes(semantic[row], texels, levels, int(ground[row, LEVEL]), view, depth_m, ahead_m)
            else:
                semantic[row, :] = _SKY
            for column in range(canvas.touched[row, 0], canvas.touched[row, 1]):
                if faces[row, column] != 0:
                    semantic[row, column] = int(rows[int(table[faces[row, column], face.BOX]), box.LABEL])
    if depth.shape[0] > 0:
        for row in range(height):
            depth[row, :] = np.float32(ground[row, DEPTH] if ground[row, DEPTH] > 0.0 else np.inf)
            for column in range(canvas.touched[row, 0], canvas.touched[row, 1]):
                if faces[row, column] != 0:
                    depth[row, column] = np.float32(1.0) / nearness[row, column]
    if instance.shape[0] > 0:
        for row in range(height):
            instance[row, :] = -1
            for column in range(canvas.touched[row, 0], canvas.touched[row, 1]):
                if faces[row, column] != 0:
                    instance[row, column] = int(rows[int(table[faces[row, column], face.BOX]), box.INSTANCE])
