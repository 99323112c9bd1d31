"""What many verdicts mean together, through the front door: `--drive-correction`, and what the end of a run says."""

from __future__ import annotations

import json

import pytest
from suite_runs import processes

from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

BROKEN, NEAR, HOLDS = "DS under throttle 0 >= 60", "DS under clean >= 71", "DS under clean >= 20"


@pytest.fixture
def mixed(suite):
    """Every other route is too long to be finished: `NEAR` has a p-value between alpha / 2 and alpha."""

    def write(*sentences):
        folder = suite(*sentences)
        routes = [fake_route(str(number), length_m=9.0 if number % 2 else 900.0) for number in range(1, 25)]
        save_routes(routes, folder.path / "routes.xml")
        return folder

    return write


def run(folder, *args):
    return folder.runpytest_inprocess(
        "--drive-robust", "--drive-verdict", "evidence", "--drive-json", "run.json", *args
    )


def judged(folder):
    document = json.loads((folder.path / "run.json").read_text(encoding="utf-8"))
    return {item["requirement"]: item for item in document["requirements"]}


def test_without_a_correction_each_verdict_has_its_own_alpha_and_the_run_says_what_that_means(mixed):
    folder = mixed(BROKEN, NEAR, HOLDS)
    result = run(folder)
    result.assert_outcomes(passed=1, failed=2)
    found = judged(folder)
    assert 0.05 / 2 < found[NEAR]["p_value"] < 0.05
    assert {item["family"] for item in found.values()} == {1}
    output = " ".join(result.stdout.str().split())
    assert "3 verdicts from evidence: when all pass, 'all hold' is wrong at most 5% of the time" in output
    assert "'any fails' is wrong up to 14% of the time" in output


def test_a_small_alpha_is_told_with_its_digits(mixed):
    result = run(mixed(BROKEN, HOLDS), "--drive-alpha", "0.0001", "--drive-inconclusive", "fail")
    output = " ".join(result.stdout.str().split())
    assert "99.98 % interval" in output
    assert "'all hold' is wrong at most 0.01% of the time" in output
    assert "'any fails' is wrong up to 0.02% of the time" in output
    assert "(--drive-correction=holm: at most 0.01%)" in output


@processes
def test_holm_keeps_open_what_is_a_fail_only_on_its_own(mixed, workers):
    folder = mixed(NEAR, HOLDS)
    result = run(folder, "--drive-correction", "holm", "-rA", *workers)
    assert result.ret == 0
    found = judged(folder)
    assert {name: item["verdict"] for name, item in found.items()} == {NEAR: "inconclusive", HOLDS: "pass"}
    assert {item["family"] for item in found.values()} == {2}
    result.stdout.fnmatch_lines(["*'any fails' is wrong at most 5% of the time (Holm over 2)*", "*1 inconclusive*"])


@processes
def test_a_clear_fail_is_red_at_once_and_lets_holm_reject_the_next_at_the_end(mixed, workers):
    folder = mixed(BROKEN, NEAR)
    result = run(folder, "--drive-correction", "holm", *workers)
    assert result.ret == 1
    assert judged(folder)[NEAR]["verdict"] == "fail"
    result.stdout.fnmatch_lines(
        [
            "*shown: DS < 60 on routes like these; any wrong fail among 2: at most 5%",
            f"NOT GREEN: steady: {NEAR}: *, open in its test, a fail when all p-values were*",
            "*1 failed, 1 inconclusive*",
        ]
    )


def test_what_fails_at_the_end_only_makes_the_run_red_unless_it_is_waived(mixed):
    folder = mixed(BROKEN, NEAR)
    (folder.path / "suites").mkdir()
    waiver = '[[waiver]]\nrequirement = "{}"\nowner = "kim"\nreason = "new planner"\nexpires = 2999-01-01\n'
    waivers = folder.path / "suites" / "waivers.toml"
    waivers.write_text(waiver.format(BROKEN))
    assert run(folder, "--drive-correction", "holm").ret == 1
    waivers.write_text(waiver.format(BROKEN) + waiver.format(NEAR))
    assert run(folder, "--drive-correction", "holm").ret == 0


@processes
@pytest.mark.parametrize(
    ("how", "code"),
    [
        ("strict=False", 0),
        ("strict=True", 0),
        ("raises=ValueError", 1),
        ("raises=(ValueError, pytest.fail.Exception)", 0),
        pytest.param(
            "raises=pytest.RaisesExc(pytest.fail.Exception)",
            0,
            marks=pytest.mark.skipif(not hasattr(pytest, "RaisesExc"), reason="comes with pytest 8.4"),
        ),
    ],
)
def test_what_fails_at_the_end_only_may_do_so_in_a_test_that_is_expected_to_fail(mixed, how, code, workers):
    folder = mixed(BROKEN, NEAR)
    marks = f"    for item in items:\n        item.add_marker(pytest.mark.xfail({how}))\n"
    with (folder.path / "conftest.py").open("a") as conftest:
        conftest.write(f"\n\ndef pytest_collection_modifyitems(items):\n{marks}")
    result = run(folder, "--drive-correction", "holm", *workers)
    assert result.ret == code
    assert judged(folder)[NEAR]["verdict"] == "fail"
    assert result.parseoutcomes() == {"failed" if code else "xfailed": 1, "inconclusive": 1}
    assert ("NOT GREEN" in result.stdout.str()) == bool(code)


def test_an_open_verdict_that_waits_for_the_others_says_so(mixed):
    result = run(mixed(NEAR, HOLDS), "--drive-correction", "holm", "--drive-inconclusive", "fail")
    assert result.ret == 1
    result.stdout.fnmatch_lines(
        ["*open: DS < 71 is shown on its own (p = 0.0*) but not among 2 requirements yet", "*Holm's * decides*"]
    )


def test_a_correction_that_does_not_exist_is_a_usage_error(mixed, driven):
    result = run(mixed(HOLDS), "--drive-correction", "hollm")
    assert result.ret == 4
    assert "Did you mean 'holm'?" in result.stderr.str() + result.stdout.str()
    assert driven() == []


def test_the_ini_file_can_ask_for_it(mixed):
    folder = mixed(NEAR, HOLDS)
    ini = folder.path / "tox.ini"
    ini.write_text(ini.read_text() + "drive_correction = holm\n")
    result = run(folder)
    result.stdout.fnmatch_lines(["drive-robust: *correction=holm"])
    assert judged(folder)[NEAR]["verdict"] == "inconclusive"


@processes
def test_what_so_many_routes_cannot_show_is_said_once_before_anything_is_driven(mixed, workers):
    result = run(mixed(HOLDS, "DS under 200 ms latency >= 1", "RD under 200 ms latency <= 0.9"), *workers)
    lines = result.stdout.str().splitlines()
    places = [k for k, line in enumerate(lines) if "24 routes show that a limit is broken where" in line]
    assert len(places) == 1
    ends = [k for k, line in enumerate(lines) if "[100%]" in line]
    assert places[0] < ends[0]
