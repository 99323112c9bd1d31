"""Whether what `drive-robust replay` drove is what was driven before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult
    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.perturbations.setting import Setting

__all__ = ["Before", "before_of", "read_episode_file"]


@dataclass(frozen=True, slots=True)
class Before:
    """Episodes that were driven before: `label` is how people call the place.

    `folder` holds episode files, `digests` the digests of trajectories, `episode` is one episode; what there is not is
    None or empty. `asked` is False when nobody named the place.
    """

    label: str
    asked: bool
    folder: Path | None = None
    digests: Mapping[str, str] | None = None
    episode: EpisodeResult | None = None

    def verdict(self, driven: EpisodeResult, *, route: Route, setting: Setting) -> tuple[bool, str] | None:
        """(same, a clause that says so), or None when that episode is not there."""
        from pytest_drive_robust.runner.plan import Task
        from pytest_drive_robust.runner.replay import difference

        stored: EpisodeResult | None = None
        key = Task(driven.episode, route, setting).key
        if self.episode is not None and self.episode.episode == driven.episode:
            stored = self.episode
        elif self.folder is not None and (self.folder / f"{key}.npz").exists():
            stored = read_episode_file(str(self.folder / f"{key}.npz"))
        if stored is not None:
            differs = difference(driven, stored)
            return (
                not differs,
                f"DIFFERS from {self.label} {differs}" if differs else f"as in {self.label}, bit for bit",
            )
        if self.digests is None or key not in self.digests:
            return None
        if self.digests[key] == driven.trace.digest:
            return True, f"as in {self.label}, bit for bit"
        return False, f"DIFFERS from {self.label}"


def before_of(reference: str | None, episode: EpisodeResult | None) -> Before | None:
    """Where to look: the episode that was given, a run's name or file, a folder; else the newest stored run, if any.

    Raises `UsageError` for a reference that is none of these.
    """
    if reference is None and episode is not None:
        return Before("the stored episode", True, episode=episode)
    if reference is not None and Path(reference).is_dir():
        folder = Path(reference)
        within = folder / "episodes"
        return Before(f"the folder {reference}", True, folder=within if within.is_dir() else folder, episode=episode)
    path = _run_file(reference)
    if path is None:
        return None
    from pytest_drive_robust.regression.document import read_document

    label = f"the run {reference or path.stem}"
    try:
        digests = _digests(read_document(path), path)
    except UsageError:
        if reference is not None:
            raise
        return None  # nobody asked for this run
    return Before(label, reference is not None, digests=digests, episode=episode)


def read_episode_file(name: str) -> EpisodeResult:
    """The episode in a file. Raises `UsageError` when there is none."""
    from pytest_drive_robust.store.episodes import read_episode

    try:
        return read_episode(Path(name))
    except FileNotFoundError:
        raise UsageError(f"there is no episode file {name!r}. Looked from the folder {Path.cwd()}.") from None
    except Exception as error:
        raise UsageError(f"{name!r} is no stored episode: {type(error).__name__}: {error}") from error


def _run_file(reference: str | None) -> Path | None:
    from pytest_drive_robust.regression.runs import RunFolder, home_of

    if reference is not None and (reference.endswith(".json") or "/" in reference):
        if not Path(reference).is_file():
            raise UsageError(f"--run is {reference!r}, but there is no such file or folder in {Path.cwd()}.")
        return Path(reference)
    runs = RunFolder(home_of(Path.cwd()))
    if reference is None and not runs.names():
        return None
    return runs.find(reference or "latest")


def _digests(document: Mapping[str, Any], path: Path) -> dict[str, str]:
    try:
        return {str(item["key"]): str(item["trace_digest"]) for item in document["episodes"]}
    except (KeyError, TypeError) as error:
        raise UsageError(f"the run {str(path)!r} is damaged: {type(error).__name__}: {error}.") from None
