"""Whether what `drive-robust replay` drove is what was driven before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.document import damaged, read_document
from pytest_drive_robust.regression.references import StoredRuns, project_home, run_file
from pytest_drive_robust.report.numbers import counted
from pytest_drive_robust.runner.cache_key.identity import route_digest
from pytest_drive_robust.runner.replay.recording import difference
from pytest_drive_robust.store.record_files import SUFFIX, read_episode


@dataclass(frozen=True, slots=True)
class Before:
    """Episodes that were driven before: `label` is how people call the place.

    `folder` holds episode files, `digests` the digests of trajectories by episode, `routes` the digests of the routes
    by id as far as they are known, `episode` is one episode; what there is not is None or empty.
    `asked` is False when nobody named the place.
    """

    label: str
    asked: bool
    folder: Path | None = None
    digests: Mapping[Episode, str] | None = None
    routes: Mapping[str, str] = field(default_factory=dict)
    episode: EpisodeResult | None = None

    @property
    def holds(self) -> str:
        """What is there, in a few words."""
        if self.digests is None:
            return "there is no record of that agent, route, setting and seed"
        first = next(iter(self.digests), None)
        return f"it holds {counted(len(self.digests), 'episode')}" + (f", the first one is {first}" if first else "")

    def compared_with(self, driven: EpisodeResult, *, route: Route) -> tuple[bool, str] | None:
        """Return (same, a clause that says so), or None when that episode is not there."""
        if self.episode is not None and self.episode.episode == driven.episode:
            stored = [self.episode]
        else:
            stored = [] if self.folder is None else _stored(self.folder, driven)
        same = f"as in {self.label}, bit for bit"
        if stored:
            # A store keeps what earlier versions of an agent drove, too: the newest one is told of.
            differences = [difference(driven, earlier) for earlier in stored]
            return (True, same) if not all(differences) else (False, f"DIFFERS from {self.label} {differences[0]}")
        is_another_route = self.routes.get(route.id, route_digest(route)) != route_digest(route)
        if self.digests is None or driven.episode not in self.digests or is_another_route:
            return None
        if self.digests[driven.episode] == driven.trace.digest:
            return True, same
        return False, f"DIFFERS from {self.label}"


def before_of(
    reference: str | None, episode: EpisodeResult | None, *, simulator: str, stuck_stop_s: float | None
) -> Before | None:
    """Find what to compare with: the given episode, a run's name or file, a folder, or the newest stored run.

    The newest one, for which nobody asked, is left out where it was driven in another simulator or was stopped after
    another time. Raises `UsageError` for a reference that is none of these.
    """
    if reference is None and episode is not None:
        return Before("the stored episode", True, episode=episode)
    if reference and Path(reference).is_dir():
        return Before(f"the folder {reference}", True, folder=Path(reference), episode=episode)
    path = _run_file(reference)
    if path is None:
        return None
    label = f"the run {path.stem if reference is None else reference}"
    try:
        document = read_document(path)
        settings = {"simulator": simulator, "stuck_stop_s": stuck_stop_s, **(document["settings"] or {})}
        if reference is None and (settings["simulator"], settings["stuck_stop_s"]) != (simulator, stuck_stop_s):
            return None
        digests, routes = _digests(document, path), _routes(document)
    except UsageError:
        if reference is not None:
            raise
        return None  # nobody asked for this run
    return Before(label, reference is not None, digests=digests, routes=routes, episode=episode)


def read_episode_file(name: str) -> EpisodeResult:
    """Return the episode in a file. Raises `UsageError` when there is none."""
    try:
        return read_episode(Path(name))
    except FileNotFoundError:
        raise UsageError(f"there is no episode file {name!r}. Looked from the folder {Path.cwd()}.") from None
    except Exception as error:
        raise UsageError(f"{name!r} is not a stored episode: {type(error).__name__}: {error}") from error


def _run_file(reference: str | None) -> Path | None:
    runs = StoredRuns(project_home())
    if reference is None and not runs.names():
        return None
    path = run_file(runs, "latest" if reference is None else reference)
    if not path.is_file():
        raise UsageError(f"--run is {reference!r}, but there is no such file or folder in {Path.cwd()}.")
    return path


def _stored(folder: Path, driven: EpisodeResult) -> list[EpisodeResult]:
    """Return the records of the same episode in a folder of them, the newest first. Damaged files are passed over."""
    found: list[EpisodeResult] = []
    for path in sorted(folder.rglob(f"*{SUFFIX}"), key=lambda path: path.stat().st_mtime_ns, reverse=True):
        try:
            result = read_episode(path)
        except (OSError, ValueError):
            continue
        if result.episode == driven.episode:
            found.append(result)
    return found


def _digests(document: Mapping[str, Any], path: Path) -> dict[Episode, str]:
    try:
        return {
            Episode(str(item["agent"]), str(item["route_id"]), str(item["setting"]), int(item["seed"])): str(
                item["trace_digest"]
            )
            for item in document["episodes"]
        }
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(str(path), error) from None


def _routes(document: Mapping[str, Any]) -> dict[str, str]:
    """Return nothing for runs that were stored before routes were told."""
    fingerprint = document.get("fingerprint")
    routes = fingerprint.get("routes") if isinstance(fingerprint, dict) else None
    return {str(name): str(digest) for name, digest in routes.items()} if isinstance(routes, dict) else {}
