"""Opens the store that the run options name."""

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
    """Open the store that `options` name, relative to the folder `root`.

    `own` is a folder that only the processes of this run share. It takes the episodes that cannot be written to the
    store. It is the whole store with `--drive-store off` and when an external tool keeps the episodes.
    """
    if options.store == "off" or options.is_external:
        return MemoryStore() if own is None else FolderStore(own, run=run)
    return FolderStore(root / options.store, run=run, fresh=options.fresh, spill=own)
