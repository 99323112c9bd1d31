"""What a run needs of the place where its finished episodes live."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.claims import Claim

Find = Callable[[str], "EpisodeResult | None"]
"""Gives the finished episode of a key, None where there is none: a store's `get`, say."""


class EpisodeStore(Protocol):
    """Finished episodes by key, and who drives which missing one."""

    def get(self, key: str) -> EpisodeResult | None:
        """Return the finished episode, or None when it must be driven. Never raises."""

    def put(self, key: str, result: EpisodeResult) -> None:
        """Keep a finished episode: from now on `get` finds it here, whatever the disk does. Never raises."""

    def claim(self, key: str) -> Claim | None:
        """Return the right to drive an episode, or None when a living process drives it already. Never waits.

        Ask `get` once more under the claim: its last holder may have finished the episode meanwhile. Put the result
        before you release the claim. The claims of a dead process are free at once.
        """

    def problems(self) -> tuple[str, ...]:
        """Return what went wrong with the place itself, one sentence each, every one once."""


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
        """Return the claim: nobody else is there."""
        return Claim()

    def problems(self) -> tuple[str, ...]:
        """Return nothing."""
        return ()
