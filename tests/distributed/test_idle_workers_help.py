"""A worker of pytest-xdist that has no test left drives what the test of another one waits for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.plugin.idle_workers import OpenRequests
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope, routes_in_order
from pytest_drive_robust.store.events import EpisodesNeeded, Event, Judged, Spared, Used
from pytest_drive_robust.store.journal import JournalWriter
from pytest_drive_robust.testing import fake_route

ONE_LONG_TEST = """
from pytest_drive_robust import requirement

def test_long(drive):
    drive.check(requirement("DS") >= 90)

def test_short():
    pass
"""
SEEDS = ("--drive-seeds", ",".join(map(str, range(20))))
SCOPE = Scope("agent", "some", tuple(fake_route(str(number), length_m=9.0) for number in range(6)), (0, 1))


def test_one_long_test_is_driven_by_both_workers_and_says_the_same(suite, meeting, driven):
    folder = suite(test=ONE_LONG_TEST, conftest=meeting)
    both = ("--drive-sim", "meeting", "-n2")
    result = folder.runpytest_inprocess("--drive-robust", *both, *SEEDS, "--drive-json", "shared.json")
    result.assert_outcomes(passed=2)
    assert len(driven()) == len(set(driven())) == 60
    assert len({line.split()[2] for line in (folder.path / "driven.log").read_text().splitlines()}) == 2
    folder.runpytest_inprocess("--drive-robust", "--drive-fresh", *SEEDS, "--drive-json", "alone.json")
    assert judged(folder.path / "shared.json") == judged(folder.path / "alone.json")


def test_without_a_store_too(suite, meeting, driven):
    folder = suite(test=ONE_LONG_TEST, conftest=meeting)
    both = ("--drive-sim", "meeting", "-n2")
    result = folder.runpytest_inprocess("--drive-robust", *both, *SEEDS, "--drive-store", "off")
    result.assert_outcomes(passed=2)
    assert len(driven()) == len(set(driven())) == 60
    assert len({line.split()[2] for line in (folder.path / "driven.log").read_text().splitlines()}) == 2


def test_a_helper_begins_nothing_when_the_budget_is_used_up(suite, driven):
    folder = suite(test=ONE_LONG_TEST)
    result = folder.runpytest_inprocess("--drive-robust", "-n2", *SEEDS, "--drive-budget", "1ms")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["*the budget of 0.001 s is used up*"])
    assert len(driven()) <= 4


def test_a_broken_agent_is_told_of_once_and_ends_the_run(suite):
    folder = suite(
        test=ONE_LONG_TEST,
        conftest="""

class Unmakeable:
    def __init__(self):
        from pytest_drive_robust import UsageError
        raise UsageError("no weights here")

    def sensors(self):
        return ()

    def reset(self, route, seed):
        pass

    def act(self, observation):
        return Control()


AGENTS.append(Unmakeable)
""",
    )
    result = folder.runpytest_inprocess("--drive-robust", "-n2", "--drive-agent", "Unmakeable")
    result.assert_outcomes(passed=1, errors=1)


class Names:
    """What `OpenRequests` asks of the scopes of a run."""

    def of(self, marker: MarkerOptions) -> Scope:
        assert (marker.agent, marker.routes, marker.seeds) == (SCOPE.agent, SCOPE.routes_spec, SCOPE.seeds)
        return SCOPE

    def setting(self, sentence: str) -> Setting:
        return Setting.parse(sentence)


def needed(sentence: str, *, clean: bool = False) -> tuple[EpisodesNeeded, list[EpisodeRequest]]:
    setting = Setting.parse(sentence)
    need = SCOPE.need(setting, clean=clean)
    keys, twins = (tuple(task.key for task in tasks) for tasks in (need.perturbed, need.clean))
    order = [task for route in routes_in_order(SCOPE, need) for task in route.requests]
    return EpisodesNeeded(SCOPE.agent, SCOPE.routes_spec, sentence, SCOPE.seeds, keys, twins), order


@pytest.fixture
def journal(tmp_path: Path):
    writer = JournalWriter(tmp_path, name="gw0")
    questions = OpenRequests(tmp_path, Names())  # type: ignore[arg-type]

    def told(*events: Event) -> list[EpisodeRequest]:
        for event in events:
            writer(event)
        return list(questions.requests())

    yield told
    writer.close()


def test_tasks_come_in_the_order_in_which_the_verdict_reads_them(journal):
    event, order = needed("clean")
    assert journal(event) == order
    assert [task.route.id for task in order] != sorted(task.route.id for task in order), "the order must show"


def test_clean_twins_are_driven_beside_their_routes_and_not_all_before(journal):
    clean, _ = needed("clean")
    event, order = needed("200 ms latency", clean=True)
    assert journal(clean, event) == order
    assert {task.setting.is_clean for task in order[:4]} == {True, False}


def test_what_a_verdict_came_without_is_not_driven(journal):
    event, order = needed("clean")
    journal(event)
    read, rest = order[:4], order[4:]
    assert journal(Spared(tuple(task.key for task in rest))) == read
    assert journal(Used(tuple(task.key for task in read))) == []


def test_nothing_is_driven_for_a_test_that_ended_without_a_verdict(journal):
    event, order = needed("clean")
    other, others = needed("200 ms latency")
    assert journal(event, other) == order + others
    ended = Judged("test", "DS", SCOPE.agent, SCOPE.routes_spec, SCOPE.seeds, "DS", "clean", ">=", 1.0, "error")
    assert journal(ended) == others


def judged(file: Path) -> object:
    told = json.loads(file.read_text())
    return [(one["verdict"], one["value"], one["low"], one["high"]) for one in told["requirements"]]
