"""Where the episodes of a run are kept."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_drive_robust.options.run import RunOptions
    from pytest_drive_robust.store.base import EpisodeStore

__all__ = ["new_run_name", "open_store"]


def new_run_name() -> str:
    """A name that no other run has."""
    import uuid

    return uuid.uuid4().hex


def open_store(settings: RunOptions, root: Path, *, run: str, own: Path | None = None) -> EpisodeStore:
    """The store that the run was given, relative to the root folder.

    `own` is a folder that only the processes of this run share: it takes what cannot be written to the store, and
    everything when there shall be none (`--drive-store off`).
    """
    from pytest_drive_robust.store.base import MemoryStore
    from pytest_drive_robust.store.folder import FolderStore

    if settings.store == "off":
        return MemoryStore() if own is None else FolderStore(own, run=run)
    return FolderStore(root / settings.store, run=run, fresh=settings.fresh, spill=own)
