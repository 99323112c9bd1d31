"""The interface of an episode store, and the store in memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.claims import Claim

Find = Callable[[str], "EpisodeResult | None"]
"""Returns the finished episode of a key, or None when there is none, for example the `get` of a store."""


class EpisodeStore(Protocol):
    """Keeps finished episodes by key, and says which process drives a missing episode."""

    def get(self, key: str) -> EpisodeResult | None:
        """Return the finished episode, or None when it must be driven. Never raises."""

    def put(self, key: str, result: EpisodeResult) -> None:
        """Keep a finished episode. From now on `get` of this store returns it, even if the disk fails. Never raises."""

    def claim(self, key: str) -> Claim | None:
        """Return the right to drive an episode, or None when a living process drives it already. Never waits.

        Call `get` once more after you have the claim: another process may have finished the episode meanwhile. Put the
        result before you release the claim. The claims of a dead process are free at once.
        """

    def problems(self) -> tuple[str, ...]:
        """Return the problems of the store itself, one sentence for each; no sentence occurs twice."""


class MemoryStore:
    """The store of a run in one process."""

    def __init__(self) -> None:
        self._results: dict[str, EpisodeResult] = {}

    def get(self, key: str) -> EpisodeResult | None:
        """Return the finished episode, or None."""
        return self._results.get(key)

    def put(self, key: str, result: EpisodeResult) -> None:
        """Keep a finished episode."""
        self._results[key] = result

    def claim(self, key: str) -> Claim:
        """Return the claim; never None, because no other process shares this store."""
        return Claim()

    def problems(self) -> tuple[str, ...]:
        """Return an empty tuple: memory has no problems."""
        return ()
