"""A stored run as plain objects, and as data frames when pandas or polars is installed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.document import damaged
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.results.tables import columns_of
from pytest_drive_robust.store.events import Judged

_LIBRARIES = ("pandas", "polars")


def read_run(run: str | os.PathLike[str] = "latest", *, store: str | os.PathLike[str] | None = None) -> Run:
    """Return the stored run named `run`: `"latest"`, a name given with `--drive-save`, or a file of `--drive-json`.

    Traces come from the store of the project, or from the folder `store`; an episode that is missing there has an empty
    trace. Raises `UsageError` when `run` is no run, `store` no folder, or an episode in it cannot be read.
    """
    folder = None if store is None else Path(store)
    if folder is not None and not folder.is_dir():
        raise UsageError(f"the store is {os.fspath(folder)!r}, expected a folder of stored episodes.")
    return Run.of(RunRecords.stored(os.fspath(run), default_registry(), store=folder))


@dataclass(frozen=True)
class Run:
    """One run: `requirements` are the verdicts, `episodes` the results with infractions, traces and tracks.

    `options` are the run options, `versions` the versions of the software that drove the run.
    """

    label: str
    options: Mapping[str, Any]
    versions: Mapping[str, str]
    requirements: tuple[Judged, ...]
    episodes: tuple[EpisodeResult, ...]
    records: RunRecords = field(repr=False)

    @classmethod
    def of(cls, records: RunRecords) -> Run:
        """Return the run of `records` with all episodes. Raises `UsageError` for a damaged run."""
        document = records.document
        names = {item.name for item in fields(Judged)}
        try:
            judged = [
                Judged(**{**{name: item[name] for name in names & set(item)}, "seeds": tuple(item["seeds"])})
                for item in document.get("requirements", ())
            ]
        except (AttributeError, KeyError, TypeError) as error:
            raise damaged(records.label, error) from None
        versions = document.get("versions", {})
        episodes = tuple(records.results.values())
        return cls(records.label, document["settings"], versions, tuple(judged), episodes, records)

    def select(
        self,
        *,
        agent: str | None = None,
        setting: str | None = None,
        route_id: str | None = None,
        seed: int | None = None,
    ) -> Run:
        """Return the run with only the matching episodes. Raises `UnknownNameError` for a value that no episode has."""
        kept = self.episodes
        for name, given in (("agent", agent), ("setting", setting), ("route_id", route_id), ("seed", seed)):
            if given is None:
                continue
            known = {str(getattr(result.episode, name)) for result in kept}
            if str(given) not in known:
                raise UnknownNameError.of(f"{name.removesuffix('_id')} in these episodes", str(given), known)
            kept = tuple(result for result in kept if str(getattr(result.episode, name)) == str(given))
        return replace(self, episodes=kept)

    def twin(self, result: EpisodeResult) -> EpisodeResult | None:
        """Return the clean episode of equal agent, route and seed; None for a clean episode or without such a twin."""
        return self.records.twin(result.episode)

    def key(self, result: EpisodeResult) -> str:
        """Return the key of an episode in the store."""
        return self.records.keys[result.episode]

    def frame(self, table: str = "episodes", *, library: str | None = None) -> Any:
        """Return the table `"episodes"`, `"ticks"`, `"infractions"` or `"requirements"` as a data frame.

        `library` is `"pandas"` or `"polars"`; by default the first that is installed. Raises `UsageError` when the
        library is not installed, `UnknownNameError` for another table or library.
        """
        columns = columns_of(self, table)
        if library is not None and library not in _LIBRARIES:
            raise UnknownNameError.of("data frame library", library, _LIBRARIES)
        for name in (library,) if library else _LIBRARIES:
            with suppress(ModuleNotFoundError):
                return import_module(name).DataFrame(columns)
        missing = library or "neither pandas nor polars"
        raise UsageError(f"{missing} is not installed: pip install {library or _LIBRARIES[0]}.")
