"""Finds stored episodes in a store or in another folder, for commands that read what earlier runs drove."""

from __future__ import annotations

from pathlib import Path

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.base import Find
from pytest_drive_robust.store.record_files import SUFFIX, read_episode


def episode_files(folder: Path) -> list[Path]:
    """Return the files of all episodes in a store, without the ones set aside, or anywhere below another folder."""
    episodes = folder / "episodes"
    return sorted((episodes if episodes.is_dir() else folder).rglob(f"*{SUFFIX}"))


def stored_episodes(*folders: Path) -> Find:
    """Return a function that reads the episode `KEY.episode` in one of `folders`; None for one that is not there.

    The function raises `UsageError` for an episode that cannot be read.
    """
    files = {path.stem: path for folder in folders for path in episode_files(folder)}

    def find(key: str) -> EpisodeResult | None:
        path = files.get(key)
        return None if path is None else stored_episode(path)

    return find


def stored_episode(path: Path) -> EpisodeResult:
    """Return the episode in a file. Raises `UsageError`, which says what is wrong and what to do."""
    try:
        return read_episode(path)
    except (OSError, ValueError) as error:
        wrong = getattr(error, "strerror", None) or error
        raise UsageError(
            f"the stored episode {str(path)!r} cannot be read: {wrong}. Move the file away, then the episode counts as "
            "missing until it is driven again; `drive-robust store verify --fix` does so with the damaged ones of a "
            "store."
        ) from None
