"""What a run needs of the place where its finished episodes live."""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.store.claims import Claim

if TYPE_CHECKING:
    from pytest_drive_robust.options.run import RunOptions


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


def is_reusable(result: EpisodeResult) -> bool:
    """Tell whether another run would get the same by driving it again: the agent's drive, or its own exception.

    A timeout or a crash of the process may be the machine's doing, an `infra_error` is ours: those are driven again.
    """
    return ends_reusable(result.outcome, result.end)


def ends_reusable(outcome: Outcome, end: End) -> bool:
    """Tell as `is_reusable` does, for an episode of which only its end is known."""
    if outcome is Outcome.AGENT_ERROR:
        return end is End.AGENT_CRASHED
    return outcome in (Outcome.COMPLETED, Outcome.FAILED)


def new_run_name() -> str:
    """Return a name that no other run has."""
    return uuid.uuid4().hex


def open_store(options: RunOptions, root: Path, *, run: str, own: Path | None = None) -> EpisodeStore:
    """Open the store that the run was given, relative to the root folder.

    `own` is a folder that only the processes of this run share: it takes what cannot be written to the store, and
    everything when there shall be none (`--drive-store off`).
    """
    from pytest_drive_robust.store.folder import FolderStore  # loads numpy

    if options.store == "off":
        return MemoryStore() if own is None else FolderStore(own, run=run)
    return FolderStore(root / options.store, run=run, fresh=options.fresh, spill=own)
