"""Waivers in a run: xfail up to the day, red after it."""

from __future__ import annotations

import json
from datetime import date

import pytest
from report_pages import data_of
from suite_runs import processes

from pytest_drive_robust.regression import clock
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

RED = "RD under throttle 0.3 <= 0.30"
GREEN = "DS under clean >= 1"
WAIVER = """
[[waiver]]
requirement = "{requirement}"
agent = "{agent}"
owner = "kim"
reason = "new planner"
expires = {expires}
"""

TEST_CASE = f"""
import unittest
import pytest
from pytest_drive_robust import requirements

STATED = requirements("{RED}\\n{GREEN}")

class TestOld(unittest.TestCase):
    @pytest.fixture(autouse=True)
    def _drive(self, drive):
        self.drive = drive

    def test_whole(self):
        self.drive.check(STATED[0])

    def test_parts(self):
        for stated in STATED:
            with self.subTest(str(stated)):
                self.drive.check(stated)
"""


@pytest.fixture
def waived(suite):
    def write(*sentences, test=None, requirement=RED, agent="steady", expires="2999-01-01"):
        folder = suite(*sentences, test=test)
        (folder.path / "suites").mkdir()
        text = WAIVER.format(requirement=requirement, agent=agent, expires=expires)
        (folder.path / "suites" / "waivers.toml").write_text(text)
        return folder

    return write


def run(folder, *args):
    return folder.runpytest_inprocess("--drive-robust", "-rx", *args)


@processes
def test_a_waived_requirement_that_fails_is_an_xfail_with_owner_and_date(waived, workers):
    result = run(waived(RED, GREEN), *workers)
    assert result.ret == 0
    result.assert_outcomes(passed=1, xfailed=1)
    result.stdout.fnmatch_lines(
        [
            "waived, 1 failing: RD under throttle 0.3 <= 0.30 of steady (kim until 2999-01-01: new planner)",
            "XFAIL *rd-throttle-0.3-le-0.30* - waived by kim until 2999-01-01: new planner",
        ]
    )


def test_every_report_says_that_what_is_broken_is_waived(waived, monkeypatch):
    folder = waived(RED)
    summary = folder.path / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    result = run(folder, "--drive-json", "run.json", "--drive-report", "look")
    told = "waived, 1 failing: RD under throttle 0.3 <= 0.30 of steady (kim until 2999-01-01: new planner)"
    assert result.outlines.count(told) == 1
    assert json.loads((folder.path / "run.json").read_text())["notes"] == [told]
    assert data_of(folder.path / "look")["notes"] == [told]
    assert f"\n- {told.replace('<', '&lt;')}\n" in summary.read_text()


@processes
def test_after_its_date_it_is_red_and_says_that_the_waiver_has_expired(waived, workers):
    result = run(waived(RED, expires="2001-01-01"), *workers)
    assert result.ret == 1
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "RD under throttle 0.3 = *limit <= 0.30*",
            "  the waiver has expired: waived by kim until 2001-01-01: new planner",
            "waiver expired, 1 failing: *",
        ]
    )


@processes
def test_a_test_of_unittest_is_waived_too(waived, workers):
    result = run(waived(test=TEST_CASE), *workers)
    assert result.ret == 0
    result.stdout.fnmatch_lines("XFAIL *::TestOld::test_whole - waived by kim until 2999-01-01: new planner")
    result.stdout.no_fnmatch_line("*FAILED*")


SEVERAL = """
import pytest
from pytest_drive_robust import requirements

def test_several(drive):
    for stated in requirements({sentences}):
        drive.check(stated)
"""


def test_what_a_test_checks_after_a_waived_requirement_is_judged(waived):
    result = run(waived(test=SEVERAL.format(sentences=f"{RED!r}, 'DS under throttle 0.4 >= 99'")))
    assert result.ret == 1
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines("DS under throttle 0.4 = *, limit >= 99 *")


def test_a_test_in_which_only_what_is_waived_was_broken_is_an_xfail(waived):
    result = run(waived(test=SEVERAL.format(sentences=f"{RED!r}, {GREEN!r}")))
    assert result.ret == 0
    result.assert_outcomes(xfailed=1)
    result.stdout.fnmatch_lines(["steady  clean *  pass", "XFAIL *::test_several - waived by kim until 2999-01-01: *"])


@pytest.mark.parametrize(
    "test",
    [
        "@pytest.mark.xfail(strict=True)\ndef test_it(drive): drive.check(REQUIREMENT)",
        "@pytest.fixture\ndef checked(drive): drive.check(REQUIREMENT)\n\ndef test_it(checked): pass",
    ],
    ids=["expected", "in-a-fixture"],
)
def test_a_waived_requirement_is_an_xfail_wherever_it_is_checked(waived, test):
    head = f"import pytest\nfrom pytest_drive_robust import requirements\n(REQUIREMENT,) = requirements({RED!r})\n\n"
    result = run(waived(test=head + test))
    assert result.ret == 0
    result.assert_outcomes(xfailed=1)
    result.stdout.fnmatch_lines("XFAIL *::test_it - waived by kim until 2999-01-01: new planner")


def test_a_test_of_unittest_names_a_waiver_that_has_expired(waived):
    result = run(waived(test=TEST_CASE, expires="2001-01-01"))
    assert result.ret == 1
    expired = "  the waiver has expired: waived by kim until 2001-01-01: new planner"
    result.stdout.fnmatch_lines(["*TestOld.test_whole*", expired])


@pytest.mark.parametrize(("today", "code"), [("2026-12-14", 0), ("2026-12-15", 0), ("2026-12-16", 1)])
def test_the_last_day_belongs_to_the_waiver(waived, monkeypatch, today, code):
    monkeypatch.setattr(clock, "today", lambda: date.fromisoformat(today))
    assert run(waived(RED, expires="2026-12-15")).ret == code


def test_a_file_on_the_command_line_is_looked_for_where_pytest_is_called(waived, monkeypatch):
    folder = waived(RED)
    monkeypatch.chdir(folder.path / "suites")
    (folder.path / "suites" / "waivers.toml").rename("mine.toml")
    assert run(folder, "..").ret == 1
    assert run(folder, "..", "--drive-waivers=mine.toml").ret == 0


def test_the_usual_file_is_set_aside_for_one_run(waived):
    folder = waived(RED)
    assert run(folder).ret == 0
    assert run(folder, "--drive-waivers=none").ret == 1


def test_an_id_and_a_pattern_waive_too(waived):
    assert run(waived(RED, requirement="rd-throttle-*", agent="st*")).ret == 0


OWN_CONFTEST = """
from dataclasses import dataclass, replace
from pytest_drive_robust import Perturbation

@dataclass
class WeakPedal(Perturbation):
    share: float = 1.0
    phrase = "weak pedal {share}"

    def actuate(self, tick, control, inference_s):
        return None if control is None else replace(control, throttle=control.throttle * self.share)

def pytest_drive_robust_register(registry):
    registry.register_perturbation(WeakPedal)
"""
OWN_TEST = """
from pytest_drive_robust import requirements

def test_own(drive):
    drive.check(requirements("RD under weak pedal 0.3 <= 0.30")[0])
"""


def test_a_failure_that_a_conftest_below_the_root_names_is_waived_however_its_sentence_is_spelt(waived):
    folder = waived(GREEN, requirement="RD under weak pedal 0.30 <= 0.3")
    (folder.path / "suites" / "own").mkdir()
    (folder.path / "suites" / "own" / "conftest.py").write_text(OWN_CONFTEST)
    (folder.path / "suites" / "own" / "test_own.py").write_text(OWN_TEST)
    run(folder).assert_outcomes(passed=1, xfailed=1)


def test_another_agent_is_not_waived(waived):
    assert run(waived(RED, agent="seer")).ret == 1


def test_a_waived_requirement_that_passes_says_so(waived):
    result = run(waived(GREEN, requirement=GREEN))
    assert result.ret == 0
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["waiver not needed any more, all of it passes: DS under clean >= 1 of steady *"])


@processes
def test_a_waiver_that_matches_nothing_is_a_warning_unless_tests_were_left_out(waived, workers):
    folder = waived(GREEN, RED, requirement="RD under throttle 0.4 <= 0.30")
    result = run(folder, *workers)
    assert result.ret == 1
    result.stdout.fnmatch_lines(["warning: *waiver*: RD under throttle 0.4 <= 0.30 *"])
    selected = run(folder, "-k", "ds-clean", *workers)
    assert selected.ret == 0
    selected.stdout.no_fnmatch_line("warning: *waiver*")


@pytest.mark.parametrize(
    ("option", "warns"),
    [("--ignore=test_late.py", False), ("--ignore-glob=*late*", False), ("--failed-first", True)],
)
def test_a_waiver_is_warned_about_by_whether_an_option_leaves_tests_out(waived, option, warns):
    late = "RD under throttle 0.4 <= 0.30"
    folder = waived(GREEN, requirement=late if not warns else "RD under throttle 0.5 <= 0.30")
    (folder.path / "test_late.py").write_text((folder.path / "test_suite.py").read_text().replace(GREEN, late))
    lines = run(folder, option).outlines
    assert any(line.startswith("warning: ") and "waiver" in line for line in lines) is warns


def test_a_waiver_is_not_warned_about_where_the_first_failure_ended_the_run(waived):
    late = "RD under throttle 0.4 <= 0.30"
    folder = waived("DS under throttle 0.5 >= 99", late, requirement=late)
    result = run(folder, "-x")
    assert result.ret == 1
    result.stdout.no_fnmatch_line("warning: *waiver*")


@pytest.mark.parametrize(
    ("mode", "told"),
    [
        ("warn", "waiver not used, nothing fails, 1 inconclusive: "),
        ("skip", "waiver not used, nothing fails, 1 inconclusive: "),
        ("fail", "waived, 1 failing: "),
    ],
)
def test_an_open_verdict_is_failing_where_it_fails_its_test(waived, mode, told):
    folder = waived("DS under clean >= 50", requirement="DS under clean >= 50")
    routes = [fake_route(str(number), length_m=9.0 if number % 2 else 900.0) for number in range(1, 25)]
    save_routes(routes, folder.path / "routes.xml")
    result = run(folder, "--drive-verdict=evidence", f"--drive-inconclusive={mode}")
    assert result.ret == 0
    result.stdout.fnmatch_lines([f"{told}DS under clean >= 50 of steady *"])


def test_a_waiver_that_matches_nothing_is_told_where_drive_robust_init_writes_its_suite(waived):
    folder = waived(GREEN, requirement="RD under throttle 0.4 <= 0.30")
    (folder.mkdir("robustness") / "test_robustness.py").write_text((folder.path / "test_suite.py").read_text())
    run(folder, "robustness").stdout.fnmatch_lines(["warning: *waiver*: RD under throttle 0.4 <= 0.30 *"])


@processes
def test_a_plugin_that_leaves_tests_out_leaves_out_the_warning(waived, workers):
    folder = waived(GREEN, RED, requirement="RD under throttle 0.4 <= 0.30")
    with (folder.path / "conftest.py").open("a") as conftest:
        conftest.write("""

def pytest_collection_modifyitems(config, items):
    config.hook.pytest_deselected(items=items[1:])
    del items[1:]
""")
    result = run(folder, *workers)
    assert result.ret == 0
    result.stdout.no_fnmatch_line("warning: *waiver*")


def test_an_error_is_not_waived(waived):
    result = run(waived(RED), "--drive-sim", "broken")
    assert result.ret == 1
    result.assert_outcomes(errors=1)


def test_the_failure_is_a_skip_with_its_reason_in_junit(waived):
    folder = waived(RED)
    run(folder, "--junitxml", "junit.xml")
    text = (folder.path / "junit.xml").read_text()
    assert 'failures="0"' in text
    assert "waived by kim until 2999-01-01: new planner" in text
    assert 'name="drive_waived" value="waived by kim until 2999-01-01: new planner"' in text


def test_a_waiver_that_cannot_be_read_is_refused_before_anything_was_driven(waived, driven):
    result = run(waived(RED, expires="'soon'"))
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*waiver 1 in *waivers.toml* has expires = 'soon', expected a date*"])
    assert driven() == []
