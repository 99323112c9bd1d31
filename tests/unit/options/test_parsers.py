from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.options.option import GivenText
from pytest_drive_robust.options.parsers import (
    check_seeds,
    gigabytes,
    one_of,
    program,
    seed_list,
    time_limit_s,
    writable_file,
    writable_folder,
)


@pytest.mark.parametrize("text", ["", "x", "1,", "-1", "1.5", "0,0", "²"])
def test_seeds_that_are_no_distinct_whole_numbers_are_refused(text):
    with pytest.raises(UsageError, match="--drive-seeds"):
        seed_list(GivenText("--drive-seeds", text))


@pytest.mark.parametrize("seeds", [[], [True], ["0"], [0.0], [1, 1], [-1]])
def test_seeds_of_a_marker_are_checked_too(seeds):
    with pytest.raises(UsageError, match="the marker"):
        check_seeds(seeds, source="the marker")


def test_a_seed_that_no_record_keeps_is_refused():
    assert seed_list(GivenText("--drive-seeds", f"{2**53 - 1}")) == (2**53 - 1,)
    for seed in (2**53, 2**64):
        with pytest.raises(UsageError, match=rf"--drive-seeds holds {seed}, expected numbers below 2\^53"):
            seed_list(GivenText("--drive-seeds", f"0,{seed}"))


@pytest.mark.parametrize("flag", ["--drive-json", "--json"])
def test_a_folder_in_the_place_of_a_file_is_refused_with_a_file_in_it(tmp_path, flag):
    with pytest.raises(UsageError, match=rf"{flag} is .* a folder; expected a file, as in {tmp_path}/run\.json"):
        writable_file(GivenText(flag, str(tmp_path)))


@pytest.mark.skipif(os.name == "nt", reason="neither is there")
def test_a_pipe_is_refused_and_a_link_is_looked_through(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "to_pipe").symlink_to("pipe")
    for name in ("pipe", "to_pipe"):
        with pytest.raises(UsageError, match=r"--drive-json is '.*pipe', which is a pipe or a device; expected a file"):
            writable_file(GivenText("--drive-json", str(tmp_path / name)))
    (tmp_path / "link").symlink_to(Path("far", "file"))
    with pytest.raises(UsageError, match=r"--drive-json is '.*link', but there is no folder '.*far'"):
        writable_file(GivenText("--drive-json", str(tmp_path / "link")))
    (tmp_path / "far").mkdir()
    assert writable_file(GivenText("--drive-json", str(tmp_path / "link"))) == tmp_path / "link"


@pytest.mark.parametrize("parser", [writable_file, writable_folder])
def test_what_may_not_be_written_is_refused(tmp_path, monkeypatch, parser):
    asked = []
    monkeypatch.setattr("pytest_drive_robust.options.parsers.os.access", lambda *given: asked.append(given))
    with pytest.raises(UsageError, match=rf"--drive-report is '.*new', but '{tmp_path}' cannot be written to"):
        parser(GivenText("--drive-report", str(tmp_path / "new")))
    assert asked == [(tmp_path, os.W_OK)]


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


@pytest.mark.parametrize("text", ["0", "-1", "1e-10", "1e300", "1e15", "nan", "much"])
def test_gigabytes_that_no_process_can_have_are_refused(text):
    with pytest.raises(UsageError, match=r"--drive-memory is .*, expected gigabytes > 0"):
        gigabytes(GivenText("--drive-memory", text))


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
