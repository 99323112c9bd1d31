"""What is exported of which episodes, and the names of its files."""

from __future__ import annotations

from dataclasses import replace

import pytest
from result_factory import make_result, trace_of

from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.results.run import Run
from pytest_drive_robust.results.scene import Scene, scenes_of
from pytest_drive_robust.store.events import EpisodesNeeded, Used

SETTING = "200 ms latency"


def run_of(*results: EpisodeResult) -> Run:
    found = {str(number): result for number, result in enumerate(results)}
    needed = [EpisodesNeeded("driver", "101", result.episode.setting, (0,), (key,)) for key, result in found.items()]
    run = RunResult.of(RunOptions(simulator="embedded"), [*needed, Used(tuple(found))], found.get, versions={})
    return Run.of(RunRecords.of(run_as_json(run), found.get, default_registry(), label="a run"))


def test_an_episode_under_a_failure_is_called_perturbed_with_or_without_its_twin() -> None:
    clean, late = make_result("101"), make_result("101", setting=SETTING)
    assert [list(scene.episodes) for scene in scenes_of(run_of(clean, late))] == [["clean", "perturbed"]]
    assert [list(scene.episodes) for scene in scenes_of(run_of(late))] == [["perturbed"]]
    assert [list(scene.episodes) for scene in scenes_of(run_of(clean))] == [["clean"]]


def test_episodes_that_ended_before_a_tick_are_not_said_to_be_missing() -> None:
    broken = replace(make_result("101", end=End.AGENT_CRASHED, end_detail="ValueError: no", trace=trace_of(0)), ticks=0)
    with pytest.raises(UsageError, match=r"none of these episodes lasted a tick: ValueError: no\."):
        list(scenes_of(run_of(broken)))


def name_of(title: str) -> str:
    return Scene(title, {}, {}).file_name


def test_a_plain_title_is_read_in_the_name() -> None:
    assert name_of("3901 GreenLight GPS noise 15 m blind seed 0") == "3901-GreenLight-GPS-noise-15-m-blind-seed-0"


@pytest.mark.parametrize("one", ["a/b S clean x seed 0", "a-b S clean x seed 0", "a:b S clean x seed 0"])
def test_two_titles_never_share_a_file(one: str) -> None:
    other = "a b S clean x seed 0"
    assert name_of(one) != name_of(other)
    assert name_of(one).startswith(name_of(other))


@pytest.mark.parametrize("letter", ["x", "路"])
def test_a_name_fits_on_a_disk_however_long_the_title_is(letter: str) -> None:
    names = {name_of(letter * 400 + end) for end in ("a", "b")}
    assert len(names) == 2
    assert all(len(name.encode()) <= 200 for name in names)
