"""The executor behind `--drive-results`: episodes come from result files instead of a simulator."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from pytest_drive_robust.bench2drive.results.episode_from_record import episode_of
from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord
from pytest_drive_robust.bench2drive.results.results_file import UnfinishedFile, read_results
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint
from pytest_drive_robust.errors import DriveRobustError, RequirementError, UnknownNameError, UsageError, nearest
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.perturbations.sentences import CLEAN
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import EpisodeRequest

_MOST_SHOWN = 10
_OUTER_COMMA = re.compile(r",(?![^()]*\))")
_UP_TO_OUTER_EQUALS = re.compile(r"(?:\([^()]*\)|[^=(])*")


def parse_results(
    text: str, known: Mapping[str, type[Perturbation]] | None = None, reading: DriveReading | None = None
) -> dict[str, Path]:
    """Parse `"clean=DIR,latency 200 ms=DIR2"`; return each path by the sentence of its setting (`str(Setting)`).

    A part without `=` belongs to the path before it, so that paths may have commas. `known` are the perturbation
    classes (default: the built-in ones), `reading` is applied to the failures, if there is one. Raises `UsageError`,
    and `RequirementError` for a sentence that does not parse.
    """
    parts: list[str] = []
    for piece in _OUTER_COMMA.split(text):
        if "=" in piece or not parts:
            parts.append(piece)
        else:
            parts[-1] += f",{piece}"
    found: dict[str, Path] = {}
    for part in parts:
        sentence, equals, path = (word.strip() for word in _named(part))
        if not (sentence and equals and path):
            raise UsageError(
                f"--drive-results holds {part.strip()!r}, expected SETTING=FOLDER as in "
                '--drive-results "clean=results/clean,200 ms latency=results/latency".'
            )
        setting = str(_read_setting(sentence, known).read_as(reading))
        if setting in found:
            raise UsageError(f"--drive-results names {setting!r} twice: {str(found[setting])!r} and {path!r}.")
        found[setting] = Path(path)
    return found


def _named(part: str) -> tuple[str, str, str]:
    """Cut at the first `=` outside of brackets, as in `200 ms latency (reading=released)=DIR`."""
    found = _UP_TO_OUTER_EQUALS.match(part)
    end = 0 if found is None else found.end()
    return part[:end], part[end : end + 1], part[end + 1 :]


def _read_setting(sentence: str, known: Mapping[str, type[Perturbation]] | None) -> Setting:
    """Parse a setting as `Setting.parse` does; also accept `latency 200 ms` for `200 ms latency`."""
    try:
        return Setting.parse(sentence, known)
    except RequirementError as error:
        first, _, rest = sentence.partition(" ")
        try:
            return Setting.parse(f"{rest} {first}", known)
        except DriveRobustError:
            pass  # the first error names what was typed
        if nearest(sentence, [CLEAN]):
            raise RequirementError(f"there is no setting {sentence!r}. Did you mean {CLEAN!r}?") from error
        raise


@dataclass(frozen=True)
class ResultsSource:
    """The results of one setting; gives the episode of a route and a seed (the record's repetition).

    `unfinished` are the files of an evaluation that has not ended, `planned` is the planned number of episodes, None if
    it is unknown.
    """

    setting: str
    path: Path
    records: Mapping[tuple[str, int], tuple[OfficialRecord, ...]]
    folders: tuple[Path, ...]
    unfinished: tuple[UnfinishedFile, ...] = ()
    planned: int | None = None

    @classmethod
    def read(cls, setting: str, path: Path) -> ResultsSource:
        """Read the results of a setting from a file or folder. Raises `UsageError`."""
        try:
            results = read_results(path)
        except UsageError as error:
            raise UsageError(f"--drive-results, {setting!r}: {error}") from None
        found: dict[tuple[str, int], list[OfficialRecord]] = {}
        for record in results.records:
            found.setdefault((record.route, record.repetition), []).append(record)
        records_of = {key: tuple(of_key) for key, of_key in found.items()}
        return cls(setting, path, records_of, (results.folder,), results.unfinished, results.planned)

    @property
    def routes(self) -> tuple[Route, ...]:
        """A route for each id in the results, without waypoints, which verdicts do not need."""
        first: dict[str, OfficialRecord] = {}
        for records in self.records.values():
            first.setdefault(records[0].route, records[0])
        return tuple(_route(record) for record in first.values())

    def problem(self, episode: Episode, route: Route) -> str:
        """Return in a clause why the results cannot give an episode; empty if they can."""
        records = self.records.get((episode.route_id, episode.seed))
        if records is None:
            others = [seed for route_id, seed in self.records if route_id == episode.route_id]
            if not others:
                return f"route {episode.route_id} is missing"
            listed = ", ".join(map(str, sorted(others)[:_MOST_SHOWN]))
            return f"route {episode.route_id} has no repetition {episode.seed}, only {listed}"
        if len(records) > 1:
            return f"route {episode.route_id} has {len(records)} records of repetition {episode.seed}, expected one"
        scenario = records[0].scenario
        if scenario and scenario != route.scenario.type:
            return f"route {episode.route_id} is of type {scenario}, the test's route of that id {route.scenario.type}"
        return ""

    def episode(self, episode: Episode, route: Route) -> EpisodeResult:
        """Return the result of an episode. Raises `UsageError` if it is missing or its record cannot be used."""
        problem = self.problem(episode, route)
        if problem:
            raise UsageError(f"the results of {self.setting!r} in {str(self.path)!r}: {problem}.")
        (record,) = self.records[episode.route_id, episode.seed]
        return episode_of(record, agent=episode.agent, setting=self.setting, folders=self.folders)


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
        _require_own_drives(sources, failing)
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
        return self.submit(request).result()

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
            if request.episode.setting not in self._sources:
                raise self._unknown(request.episode.setting)
            future.set_result(self._sources[request.episode.setting].episode(request.episode, request.route))
        except UsageError as error:
            future.set_exception(error)
        return future

    def close(self) -> None:
        """Do nothing: there is nothing to free."""

    def _unknown(self, setting: str) -> UsageError:
        hint = f'Name them with --drive-results "...,{setting}=FOLDER".'
        return UnknownNameError.of("result set of the setting", setting, self._sources, hint=hint)


def _require_own_drives(sources: Sequence[ResultsSource], failing: Collection[str]) -> None:
    """Raise `UsageError` if two settings share a drive and one is in `failing`: that failure would cost nothing.

    Records of our exports are not checked, as they tell their setting, nor drives without a time, as of an agent that
    broke at once.
    """
    for one, other in combinations(sources, 2):
        if not {one.setting, other.setting} & set(failing):
            continue  # several settings may be compared with one clean drive
        for key in one.records.keys() & other.records.keys():
            again = {_drive_of(record) for record in other.records[key]}
            for record in one.records[key]:
                if record.own is None and record.wall_s and _drive_of(record) in again:
                    raise UsageError(
                        f"--drive-results: {one.setting!r} in {str(one.path)!r} and {other.setting!r} in "
                        f"{str(other.path)!r} have the same drive of route {record.route}, with the same time of the "
                        "day and the same duration. Give each setting the results of its own drives."
                    )


def _drive_of(record: OfficialRecord) -> tuple[object, ...]:
    """Return values that differ for two drives even with the same outcome: wall time has three decimals."""
    return record.save_name, record.status, record.score, record.game_s, record.wall_s


def _route(record: OfficialRecord) -> Route:
    scenario = ScenarioSpec(record.scenario, record.scenario, TriggerPoint(0.0, 0.0, 0.0, 0.0))
    return Route(record.route, record.town, (), scenario)
