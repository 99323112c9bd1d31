"""Episodes for Foxglove: MCAP with Foxglove's schemas, one time axis from 0, a namespace for each episode.

/road, /clean/ego, /clean/actors, /clean/plan are SceneUpdates, /tf leads from `world` to `clean` and `perturbed`,
/clean/location and /clean/told are LocationFixes, /clean/log has Log messages, /clean/state is JSON for plots.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.results.extras import require
from pytest_drive_robust.results.scene import Note, Place, Pose, Shapes, Values, scenes_of
from pytest_drive_robust.store.whole_file import whole_file

if TYPE_CHECKING:
    from pytest_drive_robust.results.run import Run
    from pytest_drive_robust.results.scene import Box, Lines, Scene

_WORLD = "world"
_INFO, _ERROR = 2, 4
_ALL = 1


def write_mcap(run: Run, folder: Path) -> Iterator[Path]:
    """Write one MCAP file per scene and yield its path. Raises `UsageError` when a library is missing."""
    writer: Any = require("mcap.writer", "mcap")
    require("foxglove_schemas_protobuf", "mcap")
    for scene in scenes_of(run):
        path = folder / f"{scene.file_name}.mcap"
        with whole_file(path) as temporary, temporary.open("wb") as file:
            _write(writer.Writer(file), scene)
        yield path


def _write(writer: Any, scene: Scene) -> None:
    writer.start(library="pytest-drive-robust")
    schemas: dict[str, int] = {}
    channels: dict[str, int] = {}
    for second, path, thing in scene.items():
        nanoseconds = round(second * 1e9)
        if isinstance(thing, Values):
            topic, schema, encoding, data = f"/{path}", "State", "json", json.dumps(thing).encode()
            described = {"type": "object", "properties": {name: {"type": "number"} for name in thing}}
        else:
            topic = "/tf" if isinstance(thing, Pose) else f"/{path}"
            schema, fields = _foxglove(path, thing, {"seconds": nanoseconds // 10**9, "nanos": nanoseconds % 10**9})
            encoding, data = "protobuf", _schema(schema)(**fields).SerializeToString()
        if schema not in schemas:
            written = json.dumps(described).encode() if encoding == "json" else _described(_schema(schema))
            name, kind = ("State", "jsonschema") if encoding == "json" else (f"foxglove.{schema}", "protobuf")
            schemas[schema] = writer.register_schema(name, kind, written)
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, encoding, schemas[schema])
        writer.add_message(channels[topic], nanoseconds, data, nanoseconds)
    writer.finish()


def _foxglove(path: str, thing: Pose | Place | Note | Shapes, stamp: dict[str, int]) -> tuple[str, dict[str, Any]]:
    """Return the Foxglove schema name and the fields of a message."""
    name = path.partition("/")[0]
    if isinstance(thing, Pose):
        pose = {"translation": {"x": thing.x_m, "y": thing.y_m}, "rotation": _turned(thing)}
        return "FrameTransform", {"timestamp": stamp, "parent_frame_id": _WORLD, "child_frame_id": name, **pose}
    if isinstance(thing, Place):
        place = {"latitude": thing.latitude_deg, "longitude": thing.longitude_deg}
        return "LocationFix", {"timestamp": stamp, "frame_id": name, **place}
    if isinstance(thing, Note):
        level = _ERROR if thing.bad else _INFO
        return "Log", {"timestamp": stamp, "level": level, "message": thing.text, "name": name}
    frame = {"timestamp": stamp, "frame_id": thing.frame or _WORLD, "frame_locked": bool(thing.frame)}
    lines = {**frame, "id": path, "lines": [line for lines in thing.lines for line in _lines(lines)]}
    boxes = [{**frame, "id": box.name, "cubes": [_cube(box)]} for box in thing.boxes]
    # Each message repeats the whole scene: a viewer that jumps to a moment reads only the last message of a topic.
    return "SceneUpdate", {"deletions": [{"type": _ALL}], "entities": [lines, *boxes]}


def _schema(name: str) -> Any:
    return getattr(require(f"foxglove_schemas_protobuf.{name}_pb2", "mcap"), name)


def _described(made: Any) -> bytes:
    """Return the serialized protobuf descriptors of a message: its file, after all files that its file imports."""
    pool: Any = require("google.protobuf.descriptor_pb2", "mcap")
    found: dict[str, Any] = {}

    def add(file: Any) -> None:
        for needed in file.dependencies:
            add(needed)
        if file.name not in found:
            found[file.name] = pool.FileDescriptorProto()
            file.CopyToProto(found[file.name])

    add(made.DESCRIPTOR.file)
    described: bytes = pool.FileDescriptorSet(file=found.values()).SerializeToString()
    return described


def _cube(box: Box) -> dict[str, Any]:
    place = {"x": box.pose.x_m, "y": box.pose.y_m, "z": box.size_m[2] / 2.0}
    pose = {"position": place, "orientation": _turned(box.pose)}
    return {"pose": pose, "size": dict(zip("xyz", box.size_m, strict=True)), "color": _colour(box.colour)}


def _lines(lines: Lines) -> Iterator[dict[str, Any]]:
    for points in lines.lines:
        shape = {"pose": {"orientation": {"w": 1.0}}, "thickness": lines.width_m, "color": _colour(lines.colour)}
        yield {**shape, "points": [{"x": x, "y": y} for x, y in points.tolist()]}


def _turned(pose: Pose) -> dict[str, float]:
    return dict(zip("zw", pose.turned, strict=True))


def _colour(colour: tuple[int, int, int]) -> dict[str, float]:
    return {**dict(zip("rgb", (part / 255.0 for part in colour), strict=True)), "a": 1.0}
