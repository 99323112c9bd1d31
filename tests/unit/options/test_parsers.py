from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.options.option import GivenText
from pytest_drive_robust.options.parsers import check_seeds, gigabytes, one_of, program, seed_list, time_limit_s


@pytest.mark.parametrize("text", ["", "x", "1,", "-1", "1.5", "0,0", "²"])
def test_seeds_that_are_no_distinct_whole_numbers_are_refused(text):
    with pytest.raises(UsageError, match="--drive-seeds"):
        seed_list(GivenText("--drive-seeds", text))


@pytest.mark.parametrize("seeds", [[], [True], ["0"], [0.0], [1, 1], [-1]])
def test_seeds_of_a_marker_are_checked_too(seeds):
    with pytest.raises(UsageError, match="the marker"):
        check_seeds(seeds, source="the marker")


@pytest.mark.parametrize(
    ("text", "expected"),
    [("", None), ("none", None), ("90", 90.0), ("500ms", 0.5), ("20m", 1200.0), ("1.5 H", 5400.0)],
)
def test_a_time_limit_has_a_unit_or_is_in_seconds(text, expected):
    assert time_limit_s(GivenText("--drive-budget", text)) == expected


@pytest.mark.parametrize("text", ["0", "-1s", "soon", "1w"])
def test_a_time_limit_that_is_no_time_is_refused(text):
    with pytest.raises(UsageError, match=r"--drive-budget is .* expected a time"):
        time_limit_s(GivenText("--drive-budget", text))


@pytest.mark.parametrize(("text", "expected"), [("", None), ("4", 4 * 10**9), ("0.5 GB", 5 * 10**8), ("2g", 2 * 10**9)])
def test_gigabytes_become_bytes(text, expected):
    assert gigabytes(GivenText("--drive-memory", text)) == expected


def test_a_name_that_is_not_known_is_refused_with_the_nearest():
    with pytest.raises(UnknownNameError, match=r"Did you mean 'fixed'\?.*Set it with --drive-metrics"):
        one_of(("bench2drive", "fixed"), "metric mode")(GivenText("--drive-metrics", "fixd"))


@pytest.mark.parametrize(
    ("text", "of_ini", "of_command_line"),
    [
        ("", "", ""),
        ("python3.8", "python3.8", "python3.8"),
        ("env/bin/python", "/root/env/bin/python", "env/bin/python"),
    ],
)
def test_a_program_that_the_ini_file_names_by_a_path_starts_from_the_root(text, of_ini, of_command_line):
    of_file = SimpleNamespace(rootpath=Path("/root"), getoption=lambda name: None)
    typed = SimpleNamespace(rootpath=Path("/root"), getoption=lambda name: text)
    assert program(GivenText("--drive-b2d-python", text, of_file)) == of_ini
    assert program(GivenText("--drive-b2d-python", text, typed)) == of_command_line
