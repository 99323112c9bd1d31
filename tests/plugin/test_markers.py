"""What the marker says of a test, and what nobody asks for then."""

from __future__ import annotations

import pytest
from report_pages import data_of
from suite_runs import run

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route


def test_a_marker_pins_agent_seeds_and_routes(suite, driven):
    test = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.drive_robust(agent="seer", routes="routes.xml:2", seeds=[4, 5])
def test_pinned(drive):
    assert drive.agent == "seer"
    drive.check(requirement("DS") >= 90)
"""
    result = run(suite(test=test), "--drive-agent", "steady")
    assert result.ret == 0
    assert driven() == ["2 4", "2 5"]


def test_a_marker_of_a_parameter_wins_over_that_of_its_function(suite, driven):
    test = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.drive_robust(agent="steady", routes="routes.xml:2")
@pytest.mark.parametrize("agent", ["steady", pytest.param("seer", marks=pytest.mark.drive_robust(agent="seer"))])
def test_pinned(drive, agent):
    assert drive.agent == agent
    drive.check(requirement("DS") >= 90)
"""
    run(suite(test=test)).assert_outcomes(passed=2)
    assert driven() == ["2 0", "2 0"]


@pytest.mark.parametrize(
    ("marked", "told"),
    [
        ("margin=2", "Here the marker or drive.check sets it, which wins: mend it there."),
        ("verdict='points'", "Here the marker or drive.check sets it, which wins: mend it there."),
        ("verdict='evidence'", "Or judge exactly these routes: verdict='list' in the marker."),
    ],
)
def test_a_rule_of_a_marker_is_to_be_mended_in_the_marker(suite, driven, marked, told):
    folder = suite("DS under clean >= 1", test=f"\npytestmark = pytest.mark.drive_robust({marked})\n")
    result = run(folder)
    assert result.ret == 4
    assert told in result.stderr.str()
    assert driven() == []


@pytest.mark.parametrize(
    ("args", "marks", "told"),
    [
        ((), 2, ""),
        ((), 1, "its weights are not there"),
        (("--drive-agent", "tcp"), 2, "its weights are not there"),
        (("--drive-agent", "steady", "--drive-routes", "dev10"), 2, "10 of 10 routes cannot be driven:"),
    ],
    ids=["nobody asks for them", "a test without a marker does", "the run names the agent", "the run names the routes"],
)
def test_an_agent_and_routes_that_nobody_asks_for_need_not_be_there(suite, args, marks, told):
    absent = """

class OneTown(LoggedSimulator):
    def check_route(self, route):
        if route.town != "Straight":
            from pytest_drive_robust.errors import RouteError
            raise RouteError(f"no town {route.town}")


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)

    def tcp():
        pass

    def check():
        from pytest_drive_robust.errors import UsageError
        raise UsageError("its weights are not there")

    tcp.check = check
    registry.register_agent("tcp", tcp)
    registry.register_simulator("one-town", lambda options: OneTown(replace(options, tick_cap=60)))
"""
    test = """
import pytest
from pytest_drive_robust import requirement

def test_first(drive):
    drive.check(requirement("DS") >= 1)

def test_second(drive):
    drive.check(requirement("DS") >= 1)
"""
    for name in ("first", "second")[:marks]:
        test = test.replace(f"def test_{name}", f"@NAMED\ndef test_{name}")
    test = test.replace("@NAMED", '@pytest.mark.drive_robust(agent="steady", routes="routes.xml")')
    folder = suite(test=test, conftest=absent)
    ini = folder.path / "tox.ini"
    ini.write_text(ini.read_text().replace("drive_agent = steady\n", "").replace("drive_routes = routes.xml\n", ""))
    result = run(folder, "--drive-sim", "one-town", *args)
    assert result.ret == (4 if told else 0)
    result.stderr.fnmatch_lines([f"ERROR: *{told}"] if told else [])


@pytest.mark.parametrize(
    ("mark", "outcome"),
    [('skipif("True", reason="not on this machine")', "skipped"), ("skip", "skipped"), ("xfail(run=False)", "xfailed")],
)
def test_what_a_test_that_is_not_run_would_drive_need_not_be_there(suite, mark, outcome):
    test = f"""
import pytest
from pytest_drive_robust import requirement

@pytest.mark.{mark}
@pytest.mark.drive_robust(agent="elsewhere")
def test_not_run(drive):
    drive.check(requirement("DS") >= 1)
"""
    run(suite("DS under clean >= 90", test=test)).assert_outcomes(passed=1, **{outcome: 1})


def test_route_files_of_one_name_are_told_apart_by_their_folders(suite):
    """In the overview's table of one metric, a row of an equal label would hide the other."""
    test = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.parametrize("folder", [pytest.param(name, marks=pytest.mark.drive_robust(routes=f"{name}/routes.xml"))
                                    for name in ("day", "night")])
def test_it(drive, folder):
    drive.check(requirement("DS") >= 1)
"""
    folder = suite(test=test)
    for name, route_id in (("day", "11"), ("night", "12")):
        (folder.path / name).mkdir()
        save_routes([fake_route(route_id)], folder.path / name / "routes.xml")
    result = run(folder, "--drive-report", "look")
    result.stdout.fnmatch_lines(["steady  clean on day/routes.xml *", "steady  clean on night/routes.xml *"])
    labels = [row["label"] for row in data_of(folder.path / "look")["rows"]]
    assert labels == ["clean on day/routes.xml", "clean on night/routes.xml"]
