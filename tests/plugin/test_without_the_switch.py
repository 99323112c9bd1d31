"""Without `--drive-robust` the plugin says what is missing and does nothing else."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])
def test_tests_that_would_drive_are_skipped_with_a_reason(suite, driven, workers):
    folder = suite("DS under clean >= 90", test="\ndef test_agent(drive_agent): pass\ndef test_plain(): pass\n")
    result = folder.runpytest_subprocess("-rs", *workers)
    assert result.ret == 0
    result.assert_outcomes(passed=1, skipped=2)
    result.stdout.fnmatch_lines(["SKIPPED*needs --drive-robust"])
    assert driven() == []


def test_a_fixture_that_is_asked_for_late_skips_too(suite):
    folder = suite(test="def test_it(request): request.getfixturevalue('drive')")
    result = folder.runpytest_inprocess("-rs")
    result.assert_outcomes(skipped=1)
    result.stdout.fnmatch_lines(["SKIPPED*needs --drive-robust"])


OWN = """
import pytest

@pytest.fixture
def drive():
    return "D:"

def test_own(drive):
    assert drive == "D:"

@pytest.mark.parametrize("drive", ["C:"])
def test_parameter(drive):
    assert drive == "C:"

class TestAround:
    @pytest.fixture
    def drive_agent(self, drive_agent):
        return drive_agent

    def test_ours(self, drive_agent):
        assert drive_agent == "steady"
"""


def test_tests_of_a_project_with_a_fixture_called_drive_run(suite, driven):
    folder = suite(test=OWN)
    folder.runpytest_inprocess().assert_outcomes(passed=2, skipped=1)
    result = folder.runpytest_inprocess("--drive-robust")
    result.assert_outcomes(passed=3)
    assert (result.ret, driven()) == (1, [])  # still not green: nothing was driven


@pytest.mark.parametrize("option", [("--drive-agent", "steady"), ("--drive-plan",), ("--drive-verdict=point",)])
def test_an_option_that_is_typed_without_the_switch_is_refused(suite, option):
    result = suite("DS under clean >= 90").runpytest_inprocess(*option)
    assert result.ret == 4
    result.stderr.fnmatch_lines([f"ERROR: {option[0]} has no effect without --drive-robust. Add --drive-robust, or*"])


def test_options_for_every_run_do_not_need_the_switch(suite, monkeypatch):
    folder = suite("DS under clean >= 90")
    folder.makeini("[pytest]\naddopts = --drive-verdict=point\ndrive_agent = steady\n")
    monkeypatch.setenv("PYTEST_ADDOPTS", "--drive-workers=1")
    folder.runpytest_inprocess().assert_outcomes(skipped=1)
    assert folder.runpytest_inprocess("--collect-only", "--drive-verdict=list").ret == 0  # what is collected is no run


def test_nothing_is_written_to_disk(suite):
    folder = suite("DS under clean >= 90")
    before = set(folder.path.iterdir()) | {folder.path / "__pycache__"}
    assert folder.runpytest_inprocess("-p", "no:cacheprovider").ret == 0
    assert set(folder.path.iterdir()) <= before


def test_help_lists_every_option_in_a_group_of_its_own(suite):
    result = suite().runpytest_inprocess("--help")
    result.stdout.fnmatch_lines(
        [
            "drive-robust: closed-loop robustness requirements *drive_agent for --drive-agent*:",
            "*--drive-robust *",
            "*--drive-agent=NAME*",
            "*--drive-routes=SPEC*",
            "*--drive-seeds=LIST*",
            "*--drive-sim=NAME*",
            "*--drive-metrics=MODE*",
            "*--drive-stuck-stop=SECONDS*",
            "*--drive-json=FILE*",
        ]
    )


@pytest.mark.parametrize(
    "args", [("--drive-robust", "--help"), ("--help", "--drive-robust"), ("-h", "--drive-seeds=x")]
)
def test_help_is_shown_whatever_else_is_asked_for(suite, args):
    """As of a project that has `--drive-robust` in `addopts`."""
    result = suite().runpytest_inprocess(*args)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["usage: *", "*--drive-agent=NAME*"])


def test_the_marker_is_documented(suite):
    result = suite().runpytest_inprocess("--markers", "--drive-robust")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["@pytest.mark.drive_robust(agent=NAME, routes=SPEC, seeds=*"])
