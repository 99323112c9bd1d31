"""Which tests run: selected, stopped, left out, none at all."""

from __future__ import annotations

import pytest
from suite_runs import GREEN, RED, processes, run


@processes
def test_collect_only_drives_nothing_and_is_green(suite, driven, workers):
    result = run(suite(GREEN), "--collect-only", "-q", *workers)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["test_suite.py::test_requirement[[]rd-throttle-0.9-le-0.30[]]"])
    assert driven() == []


@pytest.mark.parametrize("option", ["--setup-plan", "--setup-only", "--fixtures-per-test"])
def test_looking_at_fixtures_drives_nothing_and_is_green(suite, driven, option):
    assert run(suite(GREEN), option).ret == 0
    assert driven() == []


def test_requirements_are_selected_by_their_ids(suite):
    result = run(suite(GREEN, RED), "-k", "throttle-0.9")
    result.assert_outcomes(passed=1, deselected=1)


def test_exitfirst_stops_after_the_first_broken_requirement(suite, driven):
    result = run(suite(RED, GREEN), "-x")
    assert result.ret in (1, 2)
    result.assert_outcomes(failed=1)
    assert driven() == ["1 0", "1 0", "2 0", "2 0", "3 0", "3 0"]


def test_last_failed_drives_only_what_failed(suite, driven):
    folder = suite(GREEN, RED)
    run(folder)
    (folder.path / "driven.log").unlink()
    result = run(folder, "--lf", "--drive-fresh")
    result.assert_outcomes(failed=1)
    assert len(driven()) == 6


def test_last_failed_drives_nothing_that_is_stored(suite, driven):
    folder = suite(GREEN, RED)
    run(folder)
    (folder.path / "driven.log").unlink()
    result = run(folder, "--lf")
    result.assert_outcomes(failed=1)
    assert driven() == []


@pytest.mark.parametrize(
    ("test", "workers"),
    [
        ("def test_other(): pass", ()),
        ("import pytest\n@pytest.mark.skip\ndef test_it(drive): pass", ()),
        ("def test_other(): pass", ("-n2",)),
    ],
    ids=["nothing-that-drives", "all-skipped", "two-workers"],
)
def test_a_run_that_drove_nothing_is_not_green(suite, test, workers):
    result = run(suite(test=test), *workers)
    assert result.ret == 1
    result.stdout.fnmatch_lines(["NOT GREEN: --drive-robust was given but no episode was driven*"])


def test_where_there_is_no_test_the_next_step_is_to_write_one(suite, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    result = run(suite(), empty)
    assert result.ret == 5
    result.stdout.fnmatch_lines(["NOT GREEN: * No test was found: name the folder of a suite, or *drive-robust init*"])


def test_where_tests_could_not_be_collected_the_next_step_is_to_mend_them(suite):
    result = run(suite(test="import no_such_module\n"))
    assert result.ret == 2
    result.stdout.fnmatch_lines(["NOT GREEN: * Its tests could not be collected: see the errors above."])


def test_where_tests_broke_before_they_drove_the_next_step_is_to_read_their_errors(suite):
    result = run(suite(test="def test_it(drive):\n    drive.check('DS under clean >= 90')\n"))
    assert result.ret == 1
    result.stdout.fnmatch_lines(["NOT GREEN: * Its tests failed before an episode was driven: see the errors above."])


def test_where_tests_were_left_out_the_next_step_is_to_select_some(suite):
    result = run(suite("DS under clean >= 90"), "-k", "nothing_of_that_name")
    assert result.ret == 5
    result.stdout.fnmatch_lines(["NOT GREEN: * Select tests that use the drive fixture*"])
