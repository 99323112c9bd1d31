"""Verdicts from evidence, through the front door: words, marks, early stops, exit codes."""

from __future__ import annotations

import json

import pytest

from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

HOLDS, BROKEN, CLOSE = "DS under clean >= 40", "DS under throttle 0 >= 60", "DS under clean >= 50"


def thirty_routes(pytester: pytest.Pytester) -> None:
    save_routes([fake_route(str(number), length_m=9.0) for number in range(1, 31)], pytester.path / "routes.xml")


def mixed_routes(pytester: pytest.Pytester) -> None:
    """Every other route is too long to be finished: a mean near 50, and no evidence on either side."""
    routes = [fake_route(str(number), length_m=9.0 if number % 2 else 900.0) for number in range(1, 25)]
    save_routes(routes, pytester.path / "routes.xml")


def verdicts(pytester: pytest.Pytester) -> dict[str, dict[str, object]]:
    document = json.loads((pytester.path / "run.json").read_text(encoding="utf-8"))
    return {judged["requirement"]: judged for judged in document["requirements"]}


def test_evidence_stops_when_the_verdict_is_in(suite, driven) -> None:
    pytester = suite(HOLDS)
    thirty_routes(pytester)
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence", "--drive-json", "run.json")
    result.assert_outcomes(passed=1)
    judged = verdicts(pytester)[HOLDS]
    assert judged["verdict"] == "pass"
    assert judged["rule"] == "evidence"
    assert judged["planned"] == 30
    assert 0 < judged["routes"] < 30
    assert len(driven()) == judged["routes"]
    result.stdout.re_match_lines([rf"steady +clean +100\.00 \(\d+ to 100\) .* {judged['routes']}/30 +pass"])


def test_a_broken_requirement_says_what_was_shown(suite) -> None:
    pytester = suite(BROKEN)
    thirty_routes(pytester)
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["*of 30 routes x 1 seed)", "*shown: DS < 60 on routes like these, wrong at most 5%*"])


@pytest.mark.parametrize("rule", ["list", "evidence"])
def test_a_broken_requirement_and_its_row_say_over_which_routes_their_numbers_stand(suite, rule) -> None:
    pytester = suite(BROKEN, BROKEN.replace("60", "30"))
    thirty_routes(pytester)
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", rule, "--drive-json", "run.json")
    read = [judged["routes"] for judged in verdicts(pytester).values()]
    assert len(set(read)) == 2, "else this shows nothing"
    for routes in read:
        result.stdout.fnmatch_lines(
            [f"  DS and SR of the {routes} routes that this verdict read; the run's table has *"]
        )
    result.stdout.re_match_lines([rf"steady .* {max(read)}/30 +fail"])
    output = " ".join(result.stdout.str().split())
    assert "(a failing test shows the routes of its own verdict, maybe fewer)" in output


@pytest.mark.parametrize(("mode", "code"), [("warn", 0), ("fail", 1), ("skip", 0)])
def test_what_is_not_shown_is_left_open(suite, mode: str, code: int) -> None:
    pytester = suite(CLOSE)
    mixed_routes(pytester)
    result = pytester.runpytest_inprocess(
        "--drive-robust", "--drive-verdict", "evidence", "--drive-inconclusive", mode, "-rA", "-v"
    )
    assert result.ret == code
    output = result.stdout.str()
    if mode == "warn":
        result.stdout.fnmatch_lines(
            ["*INCONCLUSIVE*", f"~ steady: {CLOSE}: * after 24 of 24 routes*", "*1 inconclusive*"]
        )
    else:
        assert ("open: neither " in output) == (mode == "fail")


def test_few_routes_are_judged_as_a_list_unless_evidence_was_asked_for(suite, driven) -> None:
    pytester = suite(HOLDS)
    pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "auto", "--drive-json", "run.json")
    assert verdicts(pytester)[HOLDS]["rule"] == "list"
    before = driven()
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence")
    assert result.ret == 4
    assert "3 routes cannot carry a verdict" in result.stderr.str() + result.stdout.str()
    assert "--drive-verdict list" in result.stderr.str() + result.stdout.str()
    assert driven() == before


def test_a_margin_finer_than_the_routes_is_said_before_anything_is_driven(suite) -> None:
    pytester = suite(HOLDS)
    thirty_routes(pytester)
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence")
    lines = result.stdout.str().splitlines()
    said = next(k for k, line in enumerate(lines) if "30 routes show that a limit is broken where" in line)
    assert said < next(k for k, line in enumerate(lines) if line.startswith("test_suite.py"))


def test_a_list_verdict_is_exact_for_its_list(suite) -> None:
    pytester = suite(HOLDS, BROKEN)
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "list", "--drive-json", "run.json")
    result.assert_outcomes(passed=1, failed=1)
    assert {name: judged["verdict"] for name, judged in verdicts(pytester).items()} == {HOLDS: "pass", BROKEN: "fail"}


def test_a_list_that_stops_early_has_an_interval_that_leaves_room_for_other_routes(suite) -> None:
    pytester = suite(BROKEN)
    thirty_routes(pytester)
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "list", "--drive-json", "run.json")
    (judged,) = verdicts(pytester).values()
    assert judged["routes"] < judged["planned"] == 30
    assert judged["low"] < 1.0
    assert judged["high"] > 10.0, "else betting cannot have stopped here"
    result.stdout.fnmatch_lines([f"*(95 % interval 0.?? to ??.??, {judged['routes']} of 30 routes x 1 seed)*"])


def test_a_marker_and_a_single_check_choose_their_own_rule(suite) -> None:
    pytester = suite(
        test=f'''
import pytest
from pytest_drive_robust import requirements

(WANTED,) = requirements("{HOLDS}")

@pytest.mark.drive_robust(verdict="list")
def test_marked(drive):
    assert drive.check(WANTED).verdict_rule.kind == "list"

def test_single(drive):
    assert drive.check(WANTED, verdict="list", margin=0.2).verdict_rule.margin == 0.2
    assert drive.check(WANTED).verdict_rule.kind == "point"
'''
    )
    pytester.runpytest_inprocess("--drive-robust").assert_outcomes(passed=2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--drive-verdict", "evidance"), "Did you mean 'evidence'?"),
        (("--drive-margin", "wide"), "expected a number, as in --drive-margin 0.10"),
        (("--drive-alpha", "small"), "expected a number, as in --drive-alpha 0.05"),
        (("--drive-margin", "1.5"), "expected a number between 0 and 1. Set it with --drive-margin."),
        (("--drive-alpha", "0.7"), "expected a number between 0 and 0.5"),
        (("--drive-inconclusive", "ignore"), "warn"),
    ],
)
def test_rules_that_do_not_exist_are_usage_errors(suite, driven, options, message: str) -> None:
    result = suite(HOLDS).runpytest_inprocess("--drive-robust", *options)
    assert result.ret == 4
    assert message in result.stderr.str() + result.stdout.str()
    assert driven() == []


LAZY = """
def lazy():
    return ScriptedAgent([Control(throttle=1.0)] * 8 + [Control(brake=1.0)])

AGENTS.append(lazy)
"""


@pytest.mark.parametrize("rule", ["evidence", "list", "point"])
def test_an_agent_that_hardly_drives_leaves_its_degradation_open(suite, rule: str) -> None:
    pytester = suite("RD under throttle 0.9 <= 0.90", conftest=LAZY)
    save_routes([fake_route(str(number), length_m=60.0) for number in range(1, 31)], pytester.path / "routes.xml")
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", rule, "--drive-agent", "lazy")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["~ lazy: RD under throttle 0.9*", "*floor of 30*"])


def test_a_fail_of_an_agent_that_hardly_drives_is_told_as_a_fail(suite) -> None:
    pytester = suite("RD under throttle 0.3 <= 0.10", conftest=LAZY)
    result = pytester.runpytest_inprocess(
        "--drive-robust", "--drive-verdict", "list", "--drive-agent", "lazy", "--drive-json", "run.json"
    )
    result.assert_outcomes(failed=1)
    result.stdout.no_fnmatch_line("*open: *")
    (judged,) = verdicts(pytester).values()
    assert (judged["verdict"], judged["message"]) == ("fail", "")


def test_a_pass_over_a_clean_score_below_the_floor_is_read_on_to_where_the_clean_score_is_known(suite) -> None:
    pytester = suite("RD under throttle 0.9 <= 0.30")
    names = [str(number) for number in range(1, 81)]
    routes = {name: fake_route(name, length_m=9.0) for name in names}
    order = planned_order(names, [routes[name].scenario.type for name in names], "steady")
    for name in order[:40]:  # too long to be finished: the clean score of these is next to nothing
        routes[name] = fake_route(name, length_m=900.0)
    save_routes([routes[name] for name in names], pytester.path / "routes.xml")
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence", "--drive-json", "run.json")
    result.assert_outcomes(passed=1)
    (judged,) = verdicts(pytester).values()
    assert (judged["verdict"], judged["message"]) == ("pass", "")
    assert 60 < judged["routes"] <= 80


def test_the_same_routes_come_first_however_their_file_is_named(suite, driven) -> None:
    pytester = suite(HOLDS)
    thirty_routes(pytester)
    counts = []
    for path in ("routes.xml", "./routes.xml", str(pytester.path / "routes.xml")):
        result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", "evidence", "--drive-routes", path)
        result.assert_outcomes(passed=1)
        counts.append(len(driven()))
    assert 0 < counts[0] < 30
    assert counts == counts[:1] * 3  # what is stored is not driven again


def test_routes_that_all_score_nothing_have_an_interval_that_leaves_room_for_others(suite) -> None:
    pytester = suite("RD under throttle 0 <= 0.90")
    thirty_routes(pytester)
    result = pytester.runpytest_inprocess(
        "--drive-robust", "--drive-verdict", "evidence", "--drive-inconclusive", "fail", "--drive-json", "run.json"
    )
    assert result.ret == 1
    (judged,) = verdicts(pytester).values()
    assert (judged["verdict"], judged["value"], judged["routes"]) == ("inconclusive", 1.0, 30)
    assert 0.8 < judged["low"] < 0.95
    result.stdout.fnmatch_lines(
        ["*RD under throttle 0 = 1.00, limit <= 0.90 * interval 0.?? to 1.00*", "*open: neither RD > 0.90 *"]
    )


def test_the_degradation_of_an_agent_that_hardly_drives_is_no_number(suite) -> None:
    pytester = suite(
        conftest=LAZY,
        test="""
from pytest_drive_robust import Setting
from pytest_drive_robust.registry.registry import default_registry

def test_measure(drive):
    assert drive.rd(Setting.parse("throttle 0.9", default_registry().perturbations())) <= 0.30
""",
    )
    save_routes([fake_route(str(number), length_m=60.0) for number in range(1, 4)], pytester.path / "routes.xml")
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-agent", "lazy")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["*not judged: RD under throttle 0.9*", "*floor of 30*"])


def test_workers_come_to_the_same_verdicts(suite) -> None:
    pytester = suite(HOLDS, BROKEN)
    thirty_routes(pytester)
    found = []
    for workers in ((), ("-n2",)):
        pytester.runpytest_inprocess(
            "--drive-robust", "--drive-verdict", "evidence", "--drive-json", "run.json", *workers
        ).assert_outcomes(passed=1, failed=1)
        found.append({name: (one["verdict"], one["routes"]) for name, one in verdicts(pytester).items()})
    assert found[0] == found[1]


@pytest.mark.parametrize("given", ["'many'", "[1.0, 2.0]", "__import__('numpy').array([1.0, 2.0])"])
@pytest.mark.parametrize("rule", ["point", "evidence"])
def test_a_metric_that_gives_no_number_is_named(suite, rule, given):
    metric = f"""

_register = pytest_drive_robust_register


def pytest_drive_robust_register(registry):
    _register(registry)
    registry.register_metric("bumps", lambda results: {given})
"""
    result = suite("bumps under clean <= 3", conftest=metric).runpytest_inprocess(
        "--drive-robust", "--drive-verdict", rule
    )
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*the metric bumps gave *, expected a finite number*"])
    result.stdout.no_fnmatch_line("*Traceback*")


@pytest.mark.parametrize("rule", ["evidence", "list", "point"])
def test_a_metric_of_which_no_episode_holds_data_is_named(suite, rule):
    pytester = suite("efficiency under clean >= 50")  # there is no traffic in this world
    thirty_routes(pytester)
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-verdict", rule)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["the 30 episodes under 'clean' hold no data for efficiency (speed of the ego *"])


def test_a_metric_that_writes_into_what_was_recorded_is_told_and_changes_no_other(suite):
    metric = """

@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    def bumps(results):
        for result in results:
            result.trace.rows[:] = 0.0
        return 1.0

    _known(registry)
    registry.register_metric("bumps", bumps)
"""
    pytester = suite("bumps under clean <= 3", conftest=metric)
    result = pytester.runpytest_inprocess("--drive-robust")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["the metric bumps raised ValueError: assignment destination is read-only (*"])


def test_a_requirement_whose_metric_raises_is_an_error_in_every_report(suite, monkeypatch):
    metric = """

_register = pytest_drive_robust_register


def bumps(results):
    return 1 / 0


Throttle.ladder = ("share", (0.9, 0.1))


def pytest_drive_robust_register(registry):
    _register(registry)
    registry.register_metric("bumps", bumps)
"""
    search = """

def test_search(drive):
    from pytest_drive_robust.registry.registry import default_registry
    drive.largest(default_registry().perturbations()["throttle"], metric="bumps", limit=3)
"""
    pytester = suite("bumps under clean <= 3", "DS under clean >= 0.01", conftest=metric, test=search)
    line = (pytester.path / "conftest.py").read_text().splitlines().index("    return 1 / 0") + 1
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(pytester.path / "summary.md"))
    result = pytester.runpytest_inprocess("--drive-robust", "--drive-json", "run.json")
    result.assert_outcomes(passed=1, errors=2)
    raised = f"the metric bumps raised ZeroDivisionError: division by zero (*conftest.py:{line})"
    result.stdout.fnmatch_lines(
        ["*not judged: bumps under clean <= 3", raised, "*not judged: the largest severity with bumps *", raised]
    )
    assert {name: one["verdict"] for name, one in verdicts(pytester).items()} == {
        "bumps under clean <= 3": "error",
        "DS under clean >= 0.01": "pass",
    }
    assert "1 of 2 requirements hold, 1 error" in (pytester.path / "summary.md").read_text()
