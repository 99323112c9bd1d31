"""Reads what a folder of pages holds, as a browser would: data by its scripts, motion by its bytes."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from pytest_drive_robust.report.pages.motion import VERSION

# views of the report that `tests/browser` drives
AGENT = "follower%3AFollower"
REQUIREMENT = f"#/requirement/{AGENT}/RD%20under%20GPS%20noise%2015%20m%20%3C%3D%200.01"
EPISODE = f"#/episode/{AGENT}/GPS%20noise%2015%20m/2301/0?t=4.0"
VIEWS = ("#/", REQUIREMENT, "#/failures", "#/episodes", EPISODE, "#/compare")


def data_of(folder: Path, name: str = "run") -> Any:
    """Return the plain data of `data/NAME.js`."""
    text = (folder / "data" / f"{name}.js").read_text(encoding="ascii")
    begin, end = f'driveRobust.give("{name}", ', ");\n"
    assert text.startswith(begin)
    assert text.endswith(end)
    return json.loads(text[len(begin) : -len(end)])


def motion_of(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the tables of an episode's ego and of what it was told, as `report/pages/motion.py` describes them."""
    raw = zlib.decompress(base64.b64decode(text))
    version, every, rows, told = np.frombuffer(raw[:16], "<u4").tolist()
    assert version == VERSION
    assert every == 2
    ego, place = _table(raw, 16, rows, 8)
    given, end = _table(raw, place, told, 5)
    assert end == len(raw)
    ego[:, :2] = np.cumsum(ego[:, :2], axis=0)
    return np.cumsum(ego, axis=0), np.cumsum(given, axis=0)


def _table(raw: bytes, place: int, rows: int, width: int) -> tuple[np.ndarray, int]:
    size = 4 * rows * width
    planes = np.frombuffer(raw[place : place + size], np.uint8).reshape(width, 4, rows).astype(np.int64)
    zigzag = sum(planes[:, number] << (8 * number) for number in range(4))
    return ((zigzag >> 1) ^ -(zigzag & 1)).T, place + size
