"""Collect data by drives of the expert: `python -m drive_robust_agents.training collect --agent tcp --out FOLDER`.

The written data depends only on the arguments, not on the number of workers or on interruptions: complete shards are
skipped, incomplete shards are written again.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from drive_robust_agents.training.data.collection import Collection
from drive_robust_agents.training.data.collection_file import claim
from drive_robust_agents.training.data.frames import read_done
from drive_robust_agents.training.data.pool import written
from drive_robust_agents.training.data.shards import Shard, WrittenShard
from drive_robust_agents.training.prerequisites import require_packages
from pytest_drive_robust.errors import UsageError

__all__ = ["Collected", "add_arguments", "collect", "collection_of", "run"]


@dataclass(frozen=True, slots=True)
class Collected:
    """The present content of a collection's folder."""

    rows: int
    shards: int


def collect(collection: Collection, out: Path, *, workers: int = 1, progress: bool = True) -> Collected:
    """Collect into a folder, continuing after an earlier run; return the content of the folder.

    One worker runs in this process. Raises `UsageError` for an impossible collection, and for a folder with another
    collection.
    """
    collection.check()
    if workers < 1:
        raise UsageError(f"--workers is {workers}, expected at least 1.")
    claim(collection, out)
    shards = collection.shards(out)
    done = {shard.number: found for shard in shards if (found := _done(shard)) is not None}
    rows, left = sum(int(found["rows"]) for found in done.values()), [s for s in shards if s.number not in done]
    with _Bar(len(shards), len(done), shown=progress) as bar:
        for one in written(left, workers):
            rows += one.rows
            bar.add(one)
    return Collected(rows, len(shards))


def _done(shard: Shard) -> dict[str, Any] | None:
    """Return the content of `done.json` of a complete shard with these routes, else None."""
    found = read_done(shard.folder, shard.number)
    return found if found is not None and found["routes"] == [key.id for key in shard.keys] else None


class _Bar:
    """A progress bar of shards, frames per second and the remaining time."""

    def __init__(self, shards: int, done: int, *, shown: bool) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        self._progress = Progress(
            TextColumn("collect"), BarColumn(), MofNCompleteColumn(), TextColumn("shards"),
            TextColumn("{task.fields[rows]} frames, {task.fields[rate]:.0f}/s, {task.fields[mib]:.0f} MiB"),
            TimeRemainingColumn(), disable=not shown,
        )  # fmt: skip
        self._task = self._progress.add_task("", total=shards, completed=done, rows=0, rate=0.0, mib=0.0)
        self._rows = self._bytes = 0

    def __enter__(self) -> _Bar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def add(self, written: WrittenShard) -> None:
        """Count one more shard."""
        self._rows += written.rows
        self._bytes += written.size_bytes
        seconds = self._progress.tasks[0].elapsed or 1.0
        self._progress.update(
            self._task, advance=1, rows=self._rows, rate=self._rows / seconds, mib=self._bytes / 2**20
        )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `collect`."""
    parser.add_argument("--agent", required=True, help="whose cameras: tcp, uniad, vad or simlingo")
    parser.add_argument("--out", type=Path, required=True, help="folder of the data; goes on where it stopped")
    parser.add_argument("--route-seed", type=int, default=1, help="seed of the route generator, never 0")
    parser.add_argument("--per-type", type=int, default=20, help="routes of each of the 44 scenario types")
    parser.add_argument("--types", nargs="+", default=[], metavar="TYPE", help="only these scenario types")
    parser.add_argument("--routes", type=int, default=None, help="only the first so many of them")
    parser.add_argument("--episodes", type=int, default=1, help="episodes of each route, each with its own seed")
    parser.add_argument("--seed", type=int, default=0, dest="data_seed", help="names all draws of noise and poses")
    parser.add_argument("--shard-routes", type=int, default=4, help="routes in a shard")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--dagger", default=None, metavar="WEIGHTS_OR_AGENT", help="an agent that shares the driving")
    parser.add_argument("--beta", type=float, default=0.5, help="with --dagger: the expert's share of the time")
    parser.add_argument(
        "--room", type=float, default=0.0, dest="room_s", help="seconds more that the expert leaves others"
    )
    parser.add_argument("--halt", type=float, default=0.0, dest="halt_s", help="seconds that it stands at a stop sign")
    parser.add_argument(
        "--settings", nargs="+", default=[], metavar="SETTING",
        help='with --dagger: each episode is under one of these, such as "GPS noise 15 m" or clean',
    )  # fmt: skip


def collection_of(given: argparse.Namespace) -> Collection:
    """Return the `Collection` of the options."""
    values = {field.name: getattr(given, field.name) for field in fields(Collection)}
    return Collection(**values | {"types": tuple(given.types), "settings": tuple(given.settings)})


def run(given: argparse.Namespace) -> int:
    """Collect as the options say; return the exit code, 130 when interrupted. Raises `UsageError`."""
    require_packages("rich")
    try:
        found = collect(collection_of(given), given.out, workers=given.workers)
    except KeyboardInterrupt:
        print(f"stopped; the same command goes on with what {given.out} holds")
        return 130
    print(f"{given.out}: {found.rows} frames in {found.shards} shards")
    return 0
