"""`--drive-save` and `--drive-compare`: a run is stored, and the next one is judged against it."""

from __future__ import annotations

import json

import pytest

from pytest_drive_robust.simulators.embedded.routes import save_routes
from pytest_drive_robust.testing import fake_route

HOLDS = "DS under throttle 0.9 >= 1"
ALSO = "DS under clean >= 1"

processes = pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])

SLOWER = """
import sys

def pytest_configure(config):
    global steady
    def slow():
        return ScriptedAgent([Control(throttle=0.4)])
    AGENTS[0] = slow
    slow.__name__ = "steady"
"""


def run(folder, *args):
    return folder.runpytest_inprocess("--drive-robust", "--drive-verdict=evidence", *args)


@pytest.fixture
def many(suite):
    """A suite over 40 routes: enough for evidence."""

    def write(*sentences, **given):
        folder = suite(*(sentences or (HOLDS, ALSO)), **given)
        routes = [fake_route(str(number), length_m=5.0 + 0.15 * number) for number in range(1, 41)]
        save_routes(routes, folder.path / "routes.xml")
        return folder

    return write


def slow_down(folder):
    """The same agent, worse: its code has changed."""
    conftest = folder.path / "conftest.py"
    conftest.write_text(
        conftest.read_text().replace("ScriptedAgent([Control(throttle=1.0)])", "ScriptedAgent([Control(throttle=0.3)])")
    )


def stored(folder, name):
    return json.loads((folder.path / ".drive-robust" / "runs" / f"{name}.json").read_text())


@processes
def test_a_run_is_stored_whole_with_its_fingerprint(many, workers):
    folder = many()
    result = run(folder, "--drive-save=before", *workers)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["stored as before: *"])
    document = stored(folder, "before")
    assert document["schema"] == 1
    assert document["stored"]["name"] == "before"
    assert {(item["agent"], item["setting"]) for item in document["summaries"]} == {
        ("steady", "throttle 0.9"),
        ("steady", "clean"),
    }
    assert len(document["episodes"]) == 80, "a verdict after a few routes does not cut a stored run short"
    assert {item["driving_score"] is None for item in document["episodes"]} == {False}
    fingerprint = document["fingerprint"]
    assert len(fingerprint["routes"]) == 40
    assert len(set(fingerprint["routes"].values())) == 40
    assert len(fingerprint["agents"]["steady"]["source"]) == 12
    assert [path.name for path in (folder.path / ".drive-robust" / "runs").iterdir()] == ["before.json"]
    assert (folder.path / ".drive-robust" / ".gitignore").read_text() == "*\n"


def test_without_the_options_nothing_is_stored(many):
    folder = many()
    assert run(folder).ret == 0
    assert not (folder.path / ".drive-robust").exists()


def test_a_name_is_made_up_of_date_and_time(many):
    folder = many(HOLDS)
    run(folder, "--drive-save")
    run(folder, "--drive-save")
    names = sorted(path.stem for path in (folder.path / ".drive-robust" / "runs").iterdir())
    assert len(names) == 2
    assert all(name.startswith("20") for name in names)


@processes
def test_an_unchanged_agent_is_no_regression(many, workers):
    folder = many()
    run(folder, "--drive-save=before")
    result = run(folder, "--drive-compare=before", *workers)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["*compared with before*", "no regression shown in 2 settings against before"])
    result.stdout.no_fnmatch_line("warning: *")


@processes
def test_a_worse_agent_is_red_although_its_requirements_hold(many, workers):
    folder = many()
    run(folder, "--drive-save=before")
    slow_down(folder)
    result = run(folder, "--drive-compare=before", *workers)
    assert result.ret == 1
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(
        [
            "note: the agent steady changed: source * is *",
            "steady under *: * of 40 routes changed",
            "  broken: DS drops by 5 % at most; 100.00 -> *",
            "  newly failing: * Straight",
            "    was  100.0  completed",
            "    is * out of time at 3.0 s",
            "    replay:  drive-robust replay * --agent steady --setting * --seed 0 --routes routes.xml --sim fake",
            "REGRESSION: 2 of 2 settings against before: *",
        ]
    )
    section = result.outlines[next(n for n, line in enumerate(result.outlines) if "compared with before" in line) + 1 :]
    assert all(len(line) <= 100 for line in section if line.startswith("steady "))


def test_a_comparison_comes_before_the_run_of_that_name_is_replaced(many):
    folder = many(HOLDS)
    run(folder, "--drive-save=main")
    slow_down(folder)
    assert run(folder, "--drive-compare=main", "--drive-save=main").ret == 1
    assert run(folder, "--drive-compare=main").ret == 0


def test_alone_the_option_takes_the_newest_run(many):
    folder = many(HOLDS)
    run(folder, "--drive-save=one")
    result = run(folder, "--drive-compare")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["*compared with one*"])


@pytest.mark.parametrize(
    ("args", "told"),
    [
        (("--drive-compare=befor",), "there is no stored run named 'befor'. Did you mean 'before'?"),
        (("--drive-compare=baseline",), "no baseline was blessed yet"),
        (("--drive-compare=missing.json",), "there is no run file named 'missing.json'"),
        (("--drive-compare", "test_suite.py"), "If it was meant as a path to collect, put it before --drive-compare"),
        (("--drive-save", "test_suite.py"), "If it was meant as a path to collect, put it before --drive-save"),
        (("--drive-save=latest",), "stands for something else"),
        (("--drive-compare=before", "--drive-fail-on=ds:+5%"), "--drive-fail-on is 'ds:+5%', but DS gets worse"),
        (("--drive-compare=before", "--drive-on-mismatch=wrn"), "Did you mean 'warn'?"),
        (("--drive-waivers=none.toml",), "there is no file"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_cannot_be_used_is_refused_before_anything_was_driven(many, driven, args, told):
    folder = many(HOLDS)
    run(folder, "--drive-save=before")
    (folder.path / "driven.log").unlink()
    result = run(folder, *args)
    assert result.ret == 4
    assert told in "\n".join((*result.outlines, *result.errlines))
    assert driven() == []


def test_nothing_to_compare_with_at_all_is_refused(many, driven):
    result = run(many(HOLDS), "--drive-compare")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*no baseline in * and no stored run. Store one with --drive-save*"])
    assert driven() == []


def test_routes_that_became_others_refuse_the_comparison(many):
    folder = many(HOLDS)
    run(folder, "--drive-save=before")
    save_routes([fake_route(str(number), length_m=7.0) for number in range(1, 41)], folder.path / "routes.xml")
    result = run(folder, "--drive-compare=before")
    assert result.ret == 1
    result.stdout.fnmatch_lines(
        [
            "refused: 40 of 40 routes are others by the same id: *",
            "NOT COMPARED with before: *--drive-on-mismatch=warn*",
        ]
    )
    assert run(folder, "--drive-compare=before", "--drive-on-mismatch=warn").ret == 0


def test_an_episode_that_broke_in_the_simulator_is_no_pass(many):
    folder = many(ALSO)
    run(folder, "--drive-save=before")
    conftest = folder.path / "conftest.py"
    conftest.write_text(
        conftest.read_text().replace("return LoggedSimulator(replace(options, tick_cap=60))", "return broken(options)")
    )
    result = run(folder, "--drive-compare=before")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["ERROR: not compared with before: *nothing to compare*"])
