"""What a run leaves behind besides its table: JSON by its schema, CSV, JUnit properties, the step summary of GitHub."""

from __future__ import annotations

import csv
import json
import math
from typing import Any
from xml.etree import ElementTree

import jsonschema
import pytest
from published_schema import run_schema
from suite_runs import processes

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.regression.document import episode_of
from pytest_drive_robust.report.csv_file import COLUMNS

SENTENCES = (
    "RD under throttle 0.9 <= 0.30",
    "RD under throttle 0.3 <= 0.30",
    "DS under clean >= 90",
    "RD under occlusion 0.5 <= 0.30",
)


def run(folder, *args):
    return folder.runpytest_inprocess("--drive-robust", "--drive-verdict", "point", *args)


def closed(schema: Any) -> Any:
    """The schema with every object closed: a key that it does not describe is then an error."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    changed = {key: closed(value) for key, value in schema.items()}
    if schema.get("type") == "object" and "properties" in schema:
        changed["additionalProperties"] = False
    return changed


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(run_schema())


@pytest.mark.parametrize("args", [(), ("--drive-sim", "broken"), ("--drive-agent", "faulty"), ("-n2",)], ids=" ".join)
def test_every_document_keeps_to_the_schema_and_the_schema_describes_every_key(suite, args):
    folder = suite(*SENTENCES)
    run(folder, "--drive-json", "run.json", *args)
    document = json.loads((folder.path / "run.json").read_text())
    jsonschema.validate(document, closed(run_schema()), cls=jsonschema.Draft202012Validator)
    assert document["episodes"]
    assert len(document["requirements"]) == 4


def test_a_document_that_lacks_a_key_does_not_keep_to_the_schema(suite):
    folder = suite("DS under clean >= 90")
    run(folder, "--drive-json", "run.json")
    document = json.loads((folder.path / "run.json").read_text())
    del document["episodes"][0]["outcome"]
    with pytest.raises(jsonschema.ValidationError, match="'outcome' is a required property"):
        jsonschema.validate(document, run_schema())


@processes
def test_the_csv_file_has_a_line_for_each_episode(suite, workers):
    folder = suite(*SENTENCES)
    run(folder, "--drive-csv", "run.csv", "--drive-json", "run.json", *workers)
    with (folder.path / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    episodes = json.loads((folder.path / "run.json").read_text())["episodes"]
    assert tuple(rows[0]) == COLUMNS
    assert [row["key"] for row in rows] == [episode["key"] for episode in episodes]
    assert [float(row["driving_score"]) for row in rows] == [episode["driving_score"] for episode in episodes]
    assert {row["touched"] for row in rows if row["setting"] == "throttle 0.3"} == {"control"}
    assert {row["success"] for row in rows if row["setting"] == "clean"} == {"1"}


def test_an_episode_without_a_score_has_empty_cells(suite):
    folder = suite("DS under clean >= 90")
    run(folder, "--drive-csv", "run.csv", "--drive-json", "run.json", "--drive-sim", "broken")
    with (folder.path / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    numbers = ("driving_score", "success", "route_completion_pct")
    assert {(row["outcome"], *(row[name] for name in numbers)) for row in rows} == {("infra_error", "", "", "")}
    document = json.loads((folder.path / "run.json").read_text())
    jsonschema.validate(document, run_schema())
    assert {episode[name] for episode in document["episodes"] for name in numbers} == {None}
    broken = episode_of(document["episodes"][0])
    assert (broken.outcome, broken.route_completion_pct) == (Outcome.INFRA_ERROR, 0.0)  # as in a record of the store


def test_a_csv_file_that_cannot_be_written_is_refused_before_anything_is_driven(suite, driven):
    result = run(suite("DS under clean >= 90"), "--drive-csv", "nowhere/run.csv")
    assert result.ret == 4
    result.stderr.fnmatch_lines(["*--drive-csv is 'nowhere/run.csv', but there is no folder*"])
    assert driven() == []


@processes
def test_junit_properties_are_plain_numbers(suite, workers):
    folder = suite(*SENTENCES)
    run(folder, "--junitxml", "junit.xml", *workers)
    cases = ElementTree.parse(folder.path / "junit.xml").iter("testcase")
    found = {
        case.get("name"): {item.get("name"): item.get("value") for item in case.iter("property")} for case in cases
    }
    weak = found["test_requirement[rd-throttle-0.3-le-0.30]"]
    numbers = {name: float(weak[name]) for name in ("drive_value", "drive_limit", "drive_low", "drive_high")}
    assert numbers["drive_low"] < numbers["drive_value"] < numbers["drive_high"]
    assert float(weak["drive_episode_seconds"]) > 0.0
    assert all(math.isfinite(number) for number in numbers.values())
    assert weak["drive_verdict"] == "fail"
    assert found["test_requirement[rd-occlusion-0.5-le-0.30]"]["drive_verdict"] == "error"


@processes
def test_what_drive_measures_may_be_noted_as_a_property(suite, workers):
    folder = suite(
        test="""
from pytest_drive_robust import requirements

(WEAK,) = requirements("DS under throttle 0.3 >= 10")

def test_it(drive, record_property):
    measured = drive.ds(WEAK.setting)
    record_property("ds", measured)
    record_property("both", [measured, {"again": measured}])
    record_property("outcome", drive.episodes(WEAK.setting)[0].outcome)
    record_property("verdict", drive.check(WEAK))
    record_property("number", 7)
"""
    )
    result = run(folder, "--junitxml", "junit.xml", "-o", "junit_family=xunit1", *workers)
    assert result.ret == 0
    result.assert_outcomes(passed=1)
    result.stdout.no_fnmatch_line("*INTERNALERROR*")
    (case,) = ElementTree.parse(folder.path / "junit.xml").iter("testcase")
    noted = {item.get("name"): item.get("value") for item in case.iter("property")}
    assert float(noted["ds"]) == pytest.approx(35.85, abs=0.1)
    assert noted["both"] == f"[{noted['ds']}, {{'again': {noted['ds']}}}]"
    assert noted["outcome"] == "failed"
    assert noted["number"] == "7"


def test_a_run_in_which_pytest_itself_broke_is_never_green(suite):
    conftest = """
def pytest_sessionfinish(session):
    with pytest.raises(RuntimeError) as found:
        raise RuntimeError("a worker broke")
    session.config.hook.pytest_internalerror(excrepr=found.getrepr(), excinfo=found)
"""
    result = run(suite("DS under clean >= 90", conftest=conftest))
    result.assert_outcomes(passed=1)
    assert result.ret == pytest.ExitCode.INTERNAL_ERROR


@processes
def test_the_step_summary_is_appended_where_github_asks_for_it(suite, monkeypatch, workers):
    folder = suite(*SENTENCES)
    summary = folder.path / "summary.md"
    summary.write_text("what another step wrote\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    run(folder, *workers)
    text = summary.read_text()
    assert text.startswith("what another step wrote\n## drive-robust: 2 of 4 requirements hold, 1 broken, 1 error\n")
    lines = text.splitlines()
    assert "| requirement | agent | value | interval | routes | verdict |" in lines
    (broken,) = [line for line in lines if line.startswith("| RD under throttle 0.3")]
    assert broken.startswith("| RD under throttle 0.3 &lt;= 0.30 | steady | 0.6")
    assert broken.endswith(" | 3 | **fail** |")
    assert any(line.startswith("- RD under occlusion 0.5") and "the agent has no camera" in line for line in lines)
    assert "| steady | clean | 100.00 | 1.00 | - | - | 0.00 | 3 | pass |" in lines


def test_a_summary_that_cannot_be_written_is_not_green(suite, monkeypatch):
    folder = suite("DS under clean >= 90")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(folder.path / "nowhere" / "summary.md"))
    result = run(folder)
    assert result.ret == 1
    result.stdout.fnmatch_lines(["ERROR: the step summary was not written: FileNotFoundError: *"])


def test_an_end_of_an_interval_that_is_not_there_is_no_junit_property(suite):
    folder = suite("RD under throttle 0.3 <= 0.90")
    run(folder, "--junitxml", "junit.xml", "--drive-routes", "routes.xml:1")
    text = (folder.path / "junit.xml").read_text()
    assert 'name="drive_value"' in text
    assert 'name="drive_low"' not in text
    assert '"inf"' not in text


@pytest.mark.parametrize("deed", ["raise KeyboardInterrupt", "pytest.exit('enough', returncode=0)"])
def test_a_run_that_was_interrupted_says_so(suite, monkeypatch, deed):
    folder = suite("DS under clean >= 1", test=f"\n\ndef test_ctrl_c():\n    {deed}\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(folder.path / "summary.md"))
    folder.runpytest_subprocess("--drive-robust", "--drive-verdict", "point", "--drive-json", "run.json")
    (note,) = json.loads((folder.path / "run.json").read_text())["notes"]
    assert note.startswith("the run was interrupted")
    assert "- the run was interrupted" in (folder.path / "summary.md").read_text()


def test_whatever_breaks_while_judging_is_an_error_in_every_report(suite):
    folder = suite("DS under clean >= 1")
    conftest = folder.path / "conftest.py"
    breaks = """

import pytest_drive_robust.runner.campaign


def evaluate(*args, **kwargs):
    raise RuntimeError("a bug of ours")


pytest_drive_robust.runner.campaign.evaluate = evaluate
"""
    conftest.write_text(conftest.read_text() + breaks)
    result = folder.runpytest_subprocess("--drive-robust", "--drive-json", "run.json")
    assert result.ret == 1
    (judged,) = json.loads((folder.path / "run.json").read_text())["requirements"]
    assert (judged["verdict"], judged["message"]) == ("error", "RuntimeError: a bug of ours")
