"""Paths in the ini file and in markers start from the root folder, and what is written goes where links lead."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from suite_runs import GREEN, processes, run


def test_a_route_file_of_the_ini_file_starts_from_the_root_folder(suite, monkeypatch):
    folder = suite(GREEN)
    monkeypatch.chdir(folder.mkdir("below"))
    result = run(folder, "..")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["drive-robust: * routes=3 (../routes.xml) *"])


@processes
def test_a_route_file_of_a_marker_starts_from_the_root_folder(suite, monkeypatch, driven, workers):
    test = """
import pytest
from pytest_drive_robust import requirements

@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

@pytest.mark.drive_robust(routes="routes.xml:1,2")
def test_it(elsewhere, drive):
    drive.check(requirements("DS under clean >= 90")[0])
"""
    folder = suite(test=test)
    monkeypatch.chdir(folder.mkdir("below"))
    result = run(folder, "..", "--drive-json", "run.json", *workers)
    result.assert_outcomes(passed=1)
    assert driven() == ["1 0", "2 0"]
    requirement = json.loads((folder.path / "below" / "run.json").read_text())["requirements"][0]
    assert requirement["routes_spec"] == "../routes.xml:1,2"


def test_files_to_write_that_the_ini_file_names_start_from_the_root_folder(suite, monkeypatch):
    folder = suite(GREEN)
    folder.mkdir("out")
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write("drive_json = out/run.json\ndrive_csv = run.csv\ndrive_report = out/pages\n")
    monkeypatch.chdir(folder.mkdir("below"))
    run(folder, "..").assert_outcomes(passed=1)
    assert not list(Path.cwd().iterdir())
    run(folder, "..", "--drive-csv", "mine.csv").assert_outcomes(passed=1)
    assert [path.name for path in Path.cwd().iterdir()] == ["mine.csv"]
    for name in ("out/run.json", "run.csv", "out/pages/index.html"):
        assert (folder.path / name).is_file(), name


def test_a_path_may_begin_with_the_home_folder(suite, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    folder = suite(GREEN)
    (folder.path / "routes.xml").rename(tmp_path / "mine.xml")
    options = ("--drive-routes=~/mine.xml:1", "-o", "drive_store=~/store")
    run(folder, *options, "--drive-json=~/run.json").assert_outcomes(passed=1)
    assert {path.name for path in tmp_path.iterdir()} >= {"store", "run.json"}
    assert not (folder.path / "~").exists()


@pytest.mark.skipif(os.name == "nt", reason="neither is there")
def test_reports_go_where_a_link_leads_and_never_replace_a_pipe(suite, driven):
    folder = suite(GREEN)
    os.mkfifo(folder.path / "pipe")
    for flag in ("--drive-json", "--drive-csv"):
        refused = run(folder, flag, "pipe")
        assert refused.ret == 4
        refused.stderr.fnmatch_lines([f"*{flag} is 'pipe', which is a pipe or a device; expected a file*"])
    assert (folder.path / "pipe").is_fifo()
    assert driven() == []
    links = {name: folder.path / name for name in ("run.json", "run.csv")}
    for name, link in links.items():
        link.symlink_to(Path("kept", name))
    folder.mkdir("kept")
    run(folder, "--drive-json", "run.json", "--drive-csv", "run.csv").assert_outcomes(passed=1)
    for name, link in links.items():
        assert link.is_symlink()
        assert (folder.path / "kept" / name).stat().st_size > 0
