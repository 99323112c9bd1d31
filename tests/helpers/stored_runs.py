"""Runs of one agent as the folder of stored runs keeps them."""

from __future__ import annotations

import functools
from pathlib import Path

from result_factory import crashed_simulation, scored

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.references import StoredRuns
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.results.run import Run
from pytest_drive_robust.store.events import EpisodesNeeded, Event, Identified, Spared, Used

SCORES = [100.0, 60.0, 100.0, 36.0] * 10
SETTING = "200 ms latency"


@functools.cache
def document(
    *, factor: float = 1.0, crash: bool = False, digest: str = "d0", routes: int = 40, spared: int = 0
) -> dict[str, object]:
    """Return a run of one agent, clean and under latency; `factor` is what becomes of the scores under latency.

    Its verdicts did without the last `spared` routes.
    """
    episodes: dict[str, EpisodeResult] = {}
    needed: list[Event] = []
    for setting, scale in (("clean", 1.0), (SETTING, factor)):
        results = [scored(str(n), score * scale, setting=setting) for n, score in enumerate(SCORES[:routes], start=1)]
        if crash:
            results[3] = crashed_simulation("4", setting=setting)
        keys = {f"{setting} {result.episode.route_id}": result for result in results}
        used = tuple(keys)[: routes - spared]
        episodes.update({key: keys[key] for key in used})
        needed += [EpisodesNeeded("driver", "routes.xml", setting, (0,), tuple(keys)), Used(used)]
        needed += [Spared(tuple(keys)[len(used) :])]
    digests = tuple(f"{n}={digest}" for n in range(1, routes + 1))
    identified = Identified("driver", "agents 1", "abc", "", digests)
    run = RunResult.of(RunOptions(simulator="embedded"), [identified, *needed], episodes.get, versions={})
    return run_as_json(run)


def store_run(name: str, **given: object) -> Path:
    """Store `document` of the other arguments as `name` below the current folder; return its file."""
    return StoredRuns(Path.cwd()).save(document(**given), name=name)  # type: ignore[arg-type]


def run_of(*results: EpisodeResult) -> Run:
    """Return a run of the embedded world as `read_run` does, with the traces of these episodes."""
    found = {str(number): result for number, result in enumerate(results)}
    needed = [EpisodesNeeded("driver", "101", result.episode.setting, (0,), (key,)) for key, result in found.items()]
    run = RunResult.of(RunOptions(simulator="embedded"), [*needed, Used(tuple(found))], found.get, versions={})
    return Run.of(RunRecords.of(run_as_json(run), found.get, default_registry(), label="a run"))
