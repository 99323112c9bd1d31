"""Episodes for Rerun: the content of the MCAP file, and a layout that shows the content."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_drive_robust.results.extras import require
from pytest_drive_robust.results.scene import Note, Place, Pose, Values, scenes_of
from pytest_drive_robust.store.whole_file import write_whole

if TYPE_CHECKING:
    from pytest_drive_robust.results.run import Run
    from pytest_drive_robust.results.scene import Item, Scene, Shapes

_PLOTS = ("speed_mps", "steer", "brake")


def write_rrd(run: Run, folder: Path) -> Iterator[Path]:
    """Write one Rerun file per scene and yield its path. Raises `UsageError` when the library is missing."""
    rerun: Any = require("rerun", "rrd")
    for scene in scenes_of(run):
        path = folder / f"{scene.file_name}.rrd"
        recording = rerun.RecordingStream("drive_robust", recording_id=scene.file_name)
        if hasattr(recording, "set_log_time_enabled"):  # older versions always have a second time axis
            recording.set_log_time_enabled(False)
        memory = recording.memory_recording()  # Rerun's own file writer does not report a full disk
        recording.send_blueprint(_layout(scene))
        recording.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for item in scene.items():
            _log(rerun, recording, item)
        write_whole(path, memory.drain_as_bytes())
        yield path


def _layout(scene: Scene) -> Any:
    show: Any = require("rerun.blueprint", "rrd")
    worlds = [
        show.Spatial3DView(name=name, contents=["/road", *(f"/{name}/{part}" for part in ("ego", "actors", "plan"))])
        for name in scene.episodes
    ]
    plots = [
        show.TimeSeriesView(name=signal, contents=[f"/{name}/state/{signal}" for name in scene.episodes])
        for signal in _PLOTS
    ]
    log = show.TextLogView(name="what happened", contents=[f"/{name}/log" for name in scene.episodes])
    rows = (show.Horizontal(*worlds), show.Horizontal(*plots, log))
    return show.Blueprint(show.Vertical(*rows, row_shares=[2, 1]))


def _log(rerun: Any, recording: Any, item: Item) -> None:
    second, path, thing = item
    recording.set_time("time", duration=second)
    if isinstance(thing, Pose):
        turned = rerun.Quaternion(xyzw=(0.0, 0.0, *thing.turned))
        recording.log(path, rerun.Transform3D(translation=(thing.x_m, thing.y_m, 0.0), quaternion=turned))
    elif isinstance(thing, Place):
        recording.log(path, rerun.GeoPoints(lat_lon=[tuple(thing)]))
    elif isinstance(thing, Values):
        for name, value in thing.items():
            recording.log(f"{path}/{name}", rerun.Scalars(value))
    elif isinstance(thing, Note):
        recording.log(path, rerun.TextLog(thing.text, level="ERROR" if thing.bad else "INFO"))
    else:
        for shape in _shapes(rerun, thing):
            recording.log(path, shape)


def _shapes(rerun: Any, shapes: Shapes) -> Iterator[Any]:
    """Yield the boxes and the lines, even when empty: an empty shape clears the drawing of the last tick."""
    boxes, lines = shapes.boxes, [(line, kind) for kind in shapes.lines for line in kind.lines]
    yield rerun.Boxes3D(
        centers=[(box.pose.x_m, box.pose.y_m, box.size_m[2] / 2.0) for box in boxes],
        sizes=[box.size_m for box in boxes],
        quaternions=[rerun.Quaternion(xyzw=(0.0, 0.0, *box.pose.turned)) for box in boxes],
        colors=[box.colour for box in boxes],
        labels=[box.name for box in boxes],
        show_labels=False,
    )
    yield rerun.LineStrips3D(
        [np.column_stack((line, np.zeros(len(line)))) for line, _ in lines],
        colors=[kind.colour for _, kind in lines],
        radii=[kind.width_m / 2.0 for _, kind in lines],
    )
