"""The results of one setting, read from files, which give the episode of a route and a seed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from pytest_drive_robust.bench2drive.results.episode_from_record import episode_of
from pytest_drive_robust.bench2drive.results.official_record import OfficialRecord
from pytest_drive_robust.bench2drive.results.results_file import UnfinishedFile, read_results
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint
from pytest_drive_robust.errors import UsageError

_MOST_SHOWN = 10


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


def require_own_drives(sources: Sequence[ResultsSource], failing: Collection[str]) -> None:
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
