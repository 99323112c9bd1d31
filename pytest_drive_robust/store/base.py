"""What a run needs of the place where its finished episodes live."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Protocol

from pytest_drive_robust.domain.result import EpisodeResult

__all__ = ["EpisodeStore", "MemoryStore"]


class EpisodeStore(Protocol):
    """Finished episodes by key, and who drives which missing one."""

    def get(self, key: str) -> EpisodeResult | None:
        """The finished episode, or None."""
        ...

    def put(self, key: str, result: EpisodeResult) -> None:
        """Keep a finished episode."""
        ...

    def missing(self, keys: Sequence[str]) -> Generator[str, None, None]:
        """Those of `keys` that the caller shall drive now, one at a time.

        The caller puts each one before it asks for the next. When the generator ends, every one of `keys` is
        finished, be it by the caller or by somebody else. Closing it early gives back what was claimed.
        """
        ...


class MemoryStore:
    """The store of a run in one process."""

    def __init__(self) -> None:
        self._results: dict[str, EpisodeResult] = {}

    def get(self, key: str) -> EpisodeResult | None:
        """The finished episode, or None."""
        return self._results.get(key)

    def put(self, key: str, result: EpisodeResult) -> None:
        """Keep a finished episode."""
        self._results[key] = result

    def missing(self, keys: Sequence[str]) -> Generator[str, None, None]:
        """Those of `keys` that were not driven yet, in their order."""
        for key in keys:
            if key not in self._results:
                yield key
