"""The run's shared folder: how the processes of one run see each other's episodes."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from pathlib import Path

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.claims import Claims
from pytest_drive_robust.store.episodes import read_episode, write_episode

__all__ = ["FolderStore"]

_WAIT_S = 0.05
"""How long to sleep when every missing episode is being driven by somebody else."""


class FolderStore:
    """Episodes of one run, shared by its processes.

    `offset` (0..1) is the share of a list of missing episodes that this process skips at first, so that workers
    which need the same episodes begin at different ones.
    """

    def __init__(self, folder: Path, *, offset: float = 0.0) -> None:
        self._episodes = folder / "episodes"
        self._episodes.mkdir(parents=True, exist_ok=True)
        claims = folder / "claims"
        claims.mkdir(exist_ok=True)
        self._claims = Claims(claims)
        self._offset = offset
        self._read: dict[str, EpisodeResult] = {}

    def get(self, key: str) -> EpisodeResult | None:
        """The finished episode, or None."""
        if key not in self._read and self._path(key).exists():
            self._read[key] = read_episode(self._path(key))
        return self._read.get(key)

    def put(self, key: str, result: EpisodeResult) -> None:
        """Keep a finished episode; other processes see all of it or nothing."""
        write_episode(self._path(key), result)
        self._read[key] = result

    def missing(self, keys: Sequence[str]) -> Generator[str, None, None]:
        """Claim and yield missing episodes; drive what is free first, wait only when all of them are taken."""
        skipped = int(len(keys) * self._offset)
        todo = [key for key in (*keys[skipped:], *keys[:skipped]) if not self._finished(key)]
        while todo:
            claimed_any = False
            for key in todo:
                if self._finished(key):
                    continue
                with self._claims.attempt(key) as claimed:
                    # Looked at again under the claim: it may have been finished since.
                    if claimed and not self._finished(key):
                        claimed_any = True
                        yield key
            todo = [key for key in todo if not self._finished(key)]
            if todo and not claimed_any:
                time.sleep(_WAIT_S)

    def _finished(self, key: str) -> bool:
        return key in self._read or self._path(key).exists()

    def _path(self, key: str) -> Path:
        return self._episodes / f"{key}.npz"
