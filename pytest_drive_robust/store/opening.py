"""The store of a run, as its options ask for it."""

from __future__ import annotations

import uuid
from pathlib import Path

from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.store.base import EpisodeStore, MemoryStore
from pytest_drive_robust.store.folder import FolderStore


def new_run_name() -> str:
    """Return a name that no other run has."""
    return uuid.uuid4().hex


def open_store(options: RunOptions, root: Path, *, run: str, own: Path | None = None) -> EpisodeStore:
    """Open the store that the run was given, relative to the root folder.

    `own` is a folder that only the processes of this run share: it takes what cannot be written to the store, and
    everything when there shall be none (`--drive-store off`) or somebody else keeps what was driven.
    """
    if options.store == "off" or options.is_external:
        return MemoryStore() if own is None else FolderStore(own, run=run)
    return FolderStore(root / options.store, run=run, fresh=options.fresh, spill=own)
