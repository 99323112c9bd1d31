"""`--drive-report`: a run ends with pages to look at."""

from __future__ import annotations

import json

import pytest
from report_pages import data_of

SENTENCES = ("RD under throttle 0.9 <= 0.30", "RD under throttle 0.3 <= 0.30", "DS under clean >= 90")


def run(folder, *args):
    return folder.runpytest_inprocess("--drive-robust", "--drive-verdict", "point", *args)


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])
def test_a_run_ends_with_the_path_of_its_report(suite, workers):
    folder = suite(*SENTENCES)
    result = run(folder, "--drive-report", "look", "--drive-json", "run.json", *workers)
    result.stdout.fnmatch_lines(["report: look?index.html"])
    told, document = data_of(folder.path / "look"), json.loads((folder.path / "run.json").read_text())
    assert [item["verdict"] for item in told["requirements"]] == [item["verdict"] for item in document["requirements"]]
    assert len(told["episodes"]["ds"]) == len(document["episodes"])
    assert set(told["episodes"]["trace"]) == {3}


def test_a_run_that_is_compared_shows_both(suite):
    folder = suite("DS under clean >= 1")
    run(folder, "--drive-save=before")
    run(folder, "--drive-compare=before", "--drive-save=after", "--drive-report", "look")
    comparison = data_of(folder.path / "look")["comparison"]
    assert comparison["before"] == "before"
    assert comparison["conclusion"].startswith("no regression")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (".", "which holds other things"),
        ("missing/look", "there is no folder"),
        ("conftest.py", "which is a file"),
        ("link", "which is a link that leads nowhere"),
    ],
)
def test_a_folder_that_cannot_be_written_is_refused_before_anything_ran(suite, driven, given, message):
    folder = suite("DS under clean >= 90")
    (folder.path / "link").symlink_to("nowhere")
    result = run(folder, "--drive-report", given)
    assert result.ret == 4
    assert message in "\n".join((*result.outlines, *result.errlines))
    assert driven() == []


def test_other_outputs_of_the_run_may_lie_in_the_folder(suite):
    folder = suite("DS under clean >= 1")
    (folder.path / "look").mkdir()
    for _ in range(2):
        result = run(folder, "--drive-report", "look", "--drive-json", "look/run.json", "--junitxml", "look/tests.xml")
        assert result.ret == 0
        result.stdout.fnmatch_lines(["report: look?index.html"])
        assert {"index.html", "run.json", "tests.xml"} <= {path.name for path in (folder.path / "look").iterdir()}


def test_a_report_that_cannot_be_written_is_named_and_the_run_is_not_green(suite):
    folder = suite("DS under clean >= 1")
    (folder.path / "look").mkdir()
    conftest = folder.path / "conftest.py"
    conftest.write_text(
        conftest.read_text()
        + "\n\ndef pytest_runtest_teardown(item):\n"
        + "    Path(__file__).with_name('look').joinpath('index.html').write_text('mine')\n"
    )
    result = run(folder, "--drive-report", "look")
    assert result.ret == 1
    result.stdout.fnmatch_lines(["ERROR: *look was not written: UsageError: *holds other things*"])
