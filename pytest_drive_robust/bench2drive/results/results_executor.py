"""The executor behind `--drive-results`: episodes come from result files instead of a simulator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path

from pytest_drive_robust.bench2drive.results.results_option import parse_results
from pytest_drive_robust.bench2drive.results.results_source import ResultsSource, require_own_drives
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import EpisodeRequest

_MOST_SHOWN = 10


class ResultsExecutor(Executor):
    """Answers requests from result files, at once and one at a time."""

    slots = 1

    def __init__(self, sources: Sequence[ResultsSource]) -> None:
        self._sources = {source.setting: source for source in sources}

    @classmethod
    def read(
        cls,
        text: str,
        known: Mapping[str, type[Perturbation]] | None = None,
        reading: DriveReading | None = None,
        *,
        start: Path | None = None,
    ) -> ResultsExecutor:
        """Read all results that `--drive-results` names (see `parse_results`); relative paths begin at `start`.

        Raises `UsageError`, also where two settings share a drive.
        """
        named = parse_results(text, known, reading)
        sources = [ResultsSource.read(setting, (start or Path()) / path) for setting, path in named.items()]
        failing = {name for name in named if (setting := Setting.parse(name, known)).baseline != setting}
        require_own_drives(sources, failing)
        return cls(sources)

    @property
    def routes(self) -> tuple[Route, ...]:
        """The routes of all results, each id once: the routes to judge when no route file is given."""
        found: dict[str, Route] = {}
        for source in self._sources.values():
            for route in source.routes:
                found.setdefault(route.id, route)
        return tuple(found.values())

    @property
    def repetitions(self) -> tuple[int, ...]:
        """Every repetition in the records, sorted: the seeds to judge when no seeds are given."""
        return tuple(sorted({seed for source in self._sources.values() for _, seed in source.records}))

    def require_finished(self) -> None:
        """Raise one `UsageError` that names every file of an unfinished evaluation, in which routes are missing."""
        files = [
            f"the results of {source.setting!r}: {file}"
            for source in self._sources.values()
            for file in source.unfinished
        ]
        if files:
            more = [f"and {len(files) - _MOST_SHOWN} more files"] if len(files) > _MOST_SHOWN else []
            advice = "Finish the evaluation, or name the routes to judge, with --drive-routes FILE.xml or id,id."
            head = "--drive-results names an evaluation that has not ended:"
            raise UsageError("\n  ".join([head, *files[:_MOST_SHOWN], *more, advice]))

    def unplanned(self) -> tuple[str, ...]:
        """Return a sentence for each evaluation that does not tell its planned routes: some may be missing."""
        return tuple(
            f"the results of {source.setting!r} in {str(source.path)!r} do not say how many routes were planned; those "
            f"of {len(source.routes)} are judged. Should there be more, name them: --drive-routes FILE.xml"
            for source in self._sources.values()
            if source.planned is None
        )

    def finished(self, request: EpisodeRequest) -> EpisodeResult:
        """Return the result of the request: every episode is finished already. Raises `UsageError` if it is missing."""
        setting = request.episode.setting
        if setting not in self._sources:
            raise self._unknown(setting)
        return self._sources[setting].episode(request.episode, request.route)

    def left_out(self, seeds: Collection[int]) -> str:
        """Return a sentence that counts the records of other repetitions than `seeds`; empty if there are none."""
        counts = Counter(
            seed
            for source in self._sources.values()
            for (_, seed), records in source.records.items()
            for _ in records
            if seed not in seeds
        )
        if not counts:
            return ""
        told = ", ".join(
            f"{count} record{'' if count == 1 else 's'} of repetition {seed}"
            for seed, count in sorted(counts.items())[:_MOST_SHOWN]
        )
        more = f" and of {len(counts) - _MOST_SHOWN} more" if len(counts) > _MOST_SHOWN else ""
        given = ", ".join(map(str, sorted(seeds)))
        return f"not judged: {told}{more}. The seeds are given as {given}; without seeds all repetitions are judged"

    def check(self, requests: Iterable[EpisodeRequest]) -> None:
        """Raise one `UsageError` that names every episode that `requests` need and the results lack."""
        wanted: dict[str, list[EpisodeRequest]] = {}
        for request in requests:
            wanted.setdefault(request.episode.setting, []).append(request)
        problems = []
        for setting, of_setting in wanted.items():
            if setting not in self._sources:
                problems.append(str(self._unknown(setting)))
                continue
            source = self._sources[setting]
            found = [text for request in of_setting if (text := source.problem(request.episode, request.route))]
            if found:
                more = f"; and {len(found) - _MOST_SHOWN} more" if len(found) > _MOST_SHOWN else ""
                problems.append(
                    f"the results of {setting!r} in {str(source.path)!r} lack {len(found)} of {len(of_setting)} "
                    f"episodes: {'; '.join(found[:_MOST_SHOWN])}{more}"
                )
        if problems:
            advice = (
                "Drive what is missing, or judge the routes and repetitions that all of them have: "
                "--drive-routes FILE.xml:id,id, --drive-seeds 0"
            )
            raise UsageError("\n  ".join(["--drive-results cannot answer:", *problems, advice]))

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        """Return the finished episode, or a `UsageError` as the future's exception. Never blocks."""
        future: Future[EpisodeResult] = Future()
        future.set_running_or_notify_cancel()
        try:
            future.set_result(self.finished(request))
        except UsageError as error:
            future.set_exception(error)
        return future

    def close(self) -> None:
        """Do nothing: there is nothing to free."""

    def _unknown(self, setting: str) -> UsageError:
        hint = f'Name them with --drive-results "...,{setting}=FOLDER".'
        return UnknownNameError.of("result set of the setting", setting, self._sources, hint=hint)
