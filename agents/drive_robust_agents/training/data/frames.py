"""The data set on disk: shards of plain `.npy` arrays, written whole or not at all, read without copying.

A folder holds `collect.json` (the collection) and `shard-00012/` with one file for each array and `done.json`
(rows, routes, SHA-256 of the content). A shard is written under another name and renamed when it is complete. Arrays
are rows of samples:

============ ======== ============= ====================================================================================
name         type     shape         meaning
============ ======== ============= ====================================================================================
cam_<camera> uint8    (H, W, 3)     RGB, as the agent's own camera delivers it
speed        float32  ()            m/s
imu          float32  (3,)          forward m/s2, right m/s2, yaw rate rad/s
pose         float64  (3,)          x, y, yaw in the route's frame
command      int8     (2,)          `RoadOption` by the route planner with 4 m and with 7.5 m pop distance
target       float32  (2, 2, 2)     [planner][target, next target][x, y]
future       float32  (12, 4)       the expert's ego after 0.25 ... 3 s: x, y, yaw, speed
future_ok    bool     (12,)         false beyond the end of the drive: extrapolated
path         float32  (24, 2)       1 ... 24 m ahead along the line that the expert follows
controls     float32  (5, 3)        its throttle, steer, brake now and 0.5 ... 2 s later
gap          float32  (2,)          metres to the nearest thing on its way (<= 100), speed of that along the way
boxes        float32  (24, 9)       seen actors, nearest first: x, y, sin, cos of yaw, length, width, speed, kind, valid
box_future   float32  (24, 6, 2)    where they are after 0.5 ... 3 s; NaN when gone
lanes        float32  (12, 6, 2)    map vectors, NaN rows for none
lane_kind    int8     (12,)         -1 none, 0 route, 1 lane, 2 striped, 3 solid edge, 4 stop line, 5 crosswalk
facts        float32  (16,)         see `facts.FACTS`
tag          int16    ()            index in `routes.SCENARIO_NAMES`
source       int8     ()            0 on the expert's way, 1 shifted pose, 2 start from stop, 3 DAgger
episode      int32    ()            running number of the episode
tick         int32    ()
============ ======== ============= ====================================================================================

All points are metres in the ego frame of the moment: x forward, y right. `boxes` to `lane_kind` exist only for agents
that learn from them.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.jit.arrays import Ints

__all__ = ["DONE", "Frames", "read_done", "shard_name", "shard_numbers", "write_shard"]

DONE = "done.json"
_FORMAT = 1
_EPISODES_PER_FOLDER = 10_000_000


def shard_name(number: int) -> str:
    """Return the folder name of a shard, as in `"shard-00012"`."""
    return f"shard-{number:05d}"


def shard_numbers(folder: Path) -> list[int]:
    """Return the numbers of the complete shards in a folder."""
    names = [done.parent.name.removeprefix("shard-") for done in folder.glob(f"shard-*/{DONE}")]
    return sorted(int(name) for name in names if name.isdecimal())


def write_shard(folder: Path, number: int, rows: Sequence[Mapping[str, NDArray[Any]]], about: Mapping[str, Any]) -> int:
    """Write a shard and return its size in bytes; remains of an interrupted run are deleted first.

    A shard without rows holds no arrays. `about` goes into `done.json`.
    """
    part, final = folder / f".{shard_name(number)}.part", folder / shard_name(number)
    for left in (part, final):
        shutil.rmtree(left, ignore_errors=True)
    part.mkdir(parents=True)
    digest, size = hashlib.sha256(), 0
    for name in sorted(rows[0]) if rows else ():
        array = np.stack([row[name] for row in rows])
        np.save(part / f"{name}.npy", array, allow_pickle=False)
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(np.ascontiguousarray(array).data)
        size += array.nbytes
    done = {"format": _FORMAT, "rows": len(rows), "sha256": digest.hexdigest(), **about}
    (part / DONE).write_text(json.dumps(done, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    part.rename(final)
    return size


def read_done(folder: Path, number: int) -> dict[str, Any] | None:
    """Return the content of a shard's `done.json`, or None when the shard is incomplete."""
    file = folder / shard_name(number) / DONE
    if not file.is_file():
        return None
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


class Frames:
    """All complete shards of one or more folders as one table, in the order of folders and shards.

    Arrays are read on demand. `episode` numbers of the second folder start at 10,000,000, so that no two folders share
    an episode number. Raises `UsageError` for folders without shards, or with shards whose arrays differ.
    """

    def __init__(self, *folders: Path | str) -> None:
        self._shards: list[tuple[int, Path]] = []
        lengths = []
        for place, folder in enumerate(map(Path, folders)):
            for done in sorted(folder.glob(f"shard-*/{DONE}")):
                rows = int(json.loads(done.read_text(encoding="utf-8"))["rows"])
                if rows:
                    self._shards.append((place, done.parent))
                    lengths.append(rows)
        if not self._shards:
            raise UsageError(
                f"no complete shards in {', '.join(map(str, folders)) or 'no folder'}: collect some with "
                "`python -m drive_robust_agents.training collect --agent NAME --out FOLDER`"
            )
        self._starts = np.concatenate([[0], np.cumsum(lengths)])
        self._maps: dict[tuple[int, str], NDArray[Any]] = {}
        self.names = _names(self._shards[0][1])
        for _, shard in self._shards[1:]:
            if _names(shard) != self.names:
                raise UsageError(f"{shard} and {self._shards[0][1]} hold different arrays: they were collected apart")

    def __len__(self) -> int:
        return int(self._starts[-1])

    def column(self, name: str) -> NDArray[Any]:
        """Return a copy of one array of all rows; meant for small arrays. Raises `UnknownNameError`."""
        column = np.concatenate([self._map(k, name) for k in range(len(self._shards))])
        if name == "episode":
            places = np.repeat([place for place, _ in self._shards], np.diff(self._starts))
            column = column + np.int64(_EPISODES_PER_FOLDER) * places
        return column

    def arrays(self, names: Sequence[str], rows: Ints) -> dict[str, NDArray[Any]]:
        """Return some arrays at the given rows, in any order and with repetition. Raises `UnknownNameError`."""
        rows = np.asarray(rows, dtype=np.int64)
        shards = np.searchsorted(self._starts, rows, side="right") - 1
        found = {}
        for name in names:
            first = self._map(0, name)
            out = np.empty((len(rows), *first.shape[1:]), np.int64 if name == "episode" else first.dtype)
            for k in np.unique(shards):
                mine = shards == k
                out[mine] = self._map(int(k), name)[rows[mine] - self._starts[k]]
                if name == "episode":
                    out[mine] += _EPISODES_PER_FOLDER * self._shards[k][0]
            found[name] = out
        return found

    def split(self, share: float = 0.05) -> tuple[Ints, Ints]:
        """Return (training rows, validation rows): a fixed split by whole episodes, about `share` for validation."""
        episodes = self.column("episode")
        numbers = np.unique(episodes)
        text = [hashlib.blake2b(f"split {number}".encode(), digest_size=8).digest() for number in numbers]
        held = numbers[np.array([int.from_bytes(one, "big") / 2.0**64 for one in text]) < share]
        validation = np.isin(episodes, held)
        return np.flatnonzero(~validation), np.flatnonzero(validation)

    def _map(self, shard: int, name: str) -> NDArray[Any]:
        if (shard, name) not in self._maps:
            if name not in self.names:
                raise UnknownNameError.of("array", name, self.names, hint=f"in {self._shards[shard][1]}")
            file = self._shards[shard][1] / f"{name}.npy"
            self._maps[shard, name] = np.load(file, mmap_mode="r", allow_pickle=False)
        return self._maps[shard, name]


def _names(shard: Path) -> tuple[str, ...]:
    return tuple(sorted(file.stem for file in shard.glob("*.npy")))
