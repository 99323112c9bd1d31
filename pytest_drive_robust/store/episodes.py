"""One finished episode as a file of its own."""

from __future__ import annotations

from pathlib import Path

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.store.shelf import Shelf, write_synced

__all__ = ["SUFFIX", "read_episode", "write_episode"]

SUFFIX = Shelf.SUFFIX


def write_episode(path: Path, result: EpisodeResult) -> None:
    """Write `result` so that `path` is either absent or whole, whenever the process dies or the power goes."""
    write_synced(path, encode_episode(result))


def read_episode(path: Path) -> EpisodeResult:
    """The episode in `path`, bit for bit. Raises `CorruptRecordError` (a `ValueError`) for a file that is no whole one.

    `OSError` where there is no file.
    """
    return decode_episode(path.read_bytes())
