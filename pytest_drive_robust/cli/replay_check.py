"""Whether the episodes that `drive-robust replay` drove are the same as earlier ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.document import read_document
from pytest_drive_robust.regression.references import StoredRuns, project_home, run_file
from pytest_drive_robust.report.numbers import counted
from pytest_drive_robust.runner.cache_key.identity import route_digest
from pytest_drive_robust.runner.replay.recording import difference
from pytest_drive_robust.store.lookup import episode_files, stored_episode

_SAME_LENGTH_M = 0.5
"""Tolerance of the length of a route: another version of a world may measure it a little differently."""


@dataclass(frozen=True, slots=True)
class Before:
    """Episodes that were driven before; `label` names their place in messages.

    `folder` holds episode files, `digests` the digests of trajectories by episode, `routes` the known digests of routes
    by id, `episode` is one episode; missing parts are None or empty. `asked` is False when the user named no place.
    """

    label: str
    asked: bool
    folder: Path | None = None
    digests: Mapping[Episode, str] | None = None
    routes: Mapping[str, str] = field(default_factory=dict)
    episode: EpisodeResult | None = None

    @property
    def holds(self) -> str:
        """A clause about the episodes that the place holds, where none of them is the one that was driven."""
        if self.episode is not None:
            of = f"{self.episode.scenario} of {self.episode.route_length_m:.0f} m"
            return f"it is of another route {self.episode.episode.route_id}, {of}. Name its file with --routes"
        if self.digests is None:
            return "there is no record of that agent, route, setting and seed"
        first = next(iter(self.digests), None)
        return f"it holds {counted(len(self.digests), 'episode')}" + (f", the first one is {first}" if first else "")

    def check_holds_any(self, episodes: Iterable[Episode]) -> None:
        """Raise `UsageError`, before anything is driven, if a run that the user named holds none of `episodes`."""
        if self.asked and self.digests is not None and self.digests.keys().isdisjoint(episodes):
            wanted = " or ".join(map(str, episodes))
            raise UsageError(f"{self.label} holds no {wanted}, so nothing could be compared: {self.holds}.")

    def compared_with(self, driven: EpisodeResult, *, route: Route) -> tuple[bool, str] | None:
        """Return (True when both are the same to the bit, a clause about it), or None without an earlier episode.

        Raises `UsageError` when files of the folder cannot be read and no other file holds the episode.
        """
        if self.episode is not None and self.episode.episode == driven.episode:
            stored = [self.episode]
        else:
            stored = [] if self.folder is None else _stored(self.folder, driven)
        stored = [earlier for earlier in stored if _may_be_of_one_route(earlier, driven)]
        same = f"as in {self.label}, bit for bit"
        if stored:
            # A store also keeps the episodes of earlier versions of an agent: tell the difference to the newest one.
            differences = [difference(driven, earlier) for earlier in stored]
            return (True, same) if not all(differences) else (False, f"DIFFERS from {self.label} {differences[0]}")
        is_another_route = self.routes.get(route.id, route_digest(route)) != route_digest(route)
        if self.digests is None or driven.episode not in self.digests or is_another_route:
            return None
        if self.digests[driven.episode] == driven.trace.digest:
            return True, same
        return False, f"DIFFERS from {self.label}"


def before_of(
    reference: str | None,
    episode: EpisodeResult | None,
    *,
    simulator: str,
    stuck_stop_s: float | None,
    tick_cap: int | None,
) -> Before | None:
    """Return the episodes to compare with: of `reference`, a run or a folder; else the given one; else the newest run.

    Return None where there is no run, or where the newest run cannot be read or was driven in another simulator, with
    another `stuck_stop_s` or without this `tick_cap`, which no run has. Raises `UsageError` for a reference that is no
    run, file or folder.
    """
    if reference is None and episode is not None:
        return Before("the stored episode", True, episode=episode)
    if reference and Path(reference).is_dir():
        return Before(f"the folder {reference}", True, folder=Path(reference))
    path = _run_file(reference)
    if path is None:
        return None
    label = f"the run {path.stem if reference is None else reference}"
    try:
        document = read_document(path)
        settings = {"stuck_stop_s": stuck_stop_s, **document["settings"]}
        driven_as = (settings["simulator"], settings["stuck_stop_s"], None)
        if reference is None and driven_as != (simulator, stuck_stop_s, tick_cap):
            return None
        digests, routes = _digests(document), _routes(document)
    except UsageError:
        if reference is not None:
            raise
        return None  # nobody asked for this run
    return Before(label, reference is not None, digests=digests, routes=routes)


def read_episode_file(name: str) -> EpisodeResult:
    """Return the episode in a file. Raises `UsageError` when there is none or it cannot be read."""
    if not Path(name).exists():
        raise UsageError(f"there is no episode file {name!r}. Looked from the folder {Path.cwd()}.")
    return stored_episode(Path(name))


def _run_file(reference: str | None) -> Path | None:
    runs = StoredRuns(project_home())
    if reference is None and not runs.names():
        return None
    path = run_file(runs, "latest" if reference is None else reference)
    if not path.is_file():
        raise UsageError(f"--run is {reference!r}, but there is no such file or folder in {Path.cwd()}.")
    return path


def _stored(folder: Path, driven: EpisodeResult) -> list[EpisodeResult]:
    """Return the stored results of the same episode in a folder, the newest first.

    A file that cannot be read does not tell which episode it holds: raises `UsageError` for one, if no other file holds
    the episode.
    """
    found: list[EpisodeResult] = []
    unreadable: UsageError | None = None
    for path in sorted(episode_files(folder), key=lambda path: path.stat().st_mtime_ns, reverse=True):
        try:
            result = stored_episode(path)
        except UsageError as error:
            unreadable = unreadable or error
            continue
        if result.episode == driven.episode:
            found.append(result)
    if unreadable is not None and not found:
        raise unreadable
    return found


def _may_be_of_one_route(stored: EpisodeResult, driven: EpisodeResult) -> bool:
    """Return False for two routes that have only their id in common; a drive that broke may not know the length."""
    lengths_m = stored.route_length_m, driven.route_length_m
    return stored.scenario == driven.scenario and (
        0.0 in lengths_m or abs(lengths_m[0] - lengths_m[1]) < _SAME_LENGTH_M
    )


def _digests(document: Mapping[str, Any]) -> dict[Episode, str]:
    return {
        Episode(item["agent"], item["route_id"], item["setting"], item["seed"]): item["trace_digest"]
        for item in document["episodes"]
    }


def _routes(document: Mapping[str, Any]) -> dict[str, str]:
    """Return the digest of each route by id; empty for a run that does not tell its routes."""
    return dict(document["fingerprint"]["routes"]) if "fingerprint" in document else {}
