"""`--drive-json FILE`: everything, `schema` 1, the same with and without workers."""

from __future__ import annotations

import json

import pytest


def run_json(folder, *args):
    result = folder.runpytest_inprocess("--drive-robust", "--drive-json", "run.json", *args)
    text = (folder.path / "run.json").read_text()
    assert "NaN" not in text
    assert "Infinity" not in text
    return result, json.loads(text)


def stable(document):
    """Without what may differ: wall times, and the order in which tests ended."""
    for episode in document["episodes"]:
        del episode["wall_s"]
    document["requirements"].sort(key=lambda item: item["nodeid"])
    return document


@pytest.fixture
def mixed(suite):
    return suite("RD under throttle 0.9 <= 0.30", "RD under throttle 0.3 <= 0.30", "DS under clean >= 90")


def test_the_file_holds_settings_verdicts_summaries_and_episodes(mixed):
    result, document = run_json(mixed)
    assert result.ret == 1
    assert document["schema"] == 1
    assert document["settings"] == {
        "agent": "steady",
        "routes": "routes.xml",
        "seeds": [0],
        "simulator": "fake",
        "reading": "paper",
        "metrics": "bench2drive",
        "stuck_stop_s": None,
        "verdict": "point",
        "margin": 0.10,
        "alpha": 0.05,
        "correction": "none",
        "plugins": ["conftest.py"],
    }
    assert {"python", "pytest", "pytest-drive-robust", "fake"} <= set(document["versions"])
    verdicts = {item["requirement"]: item["verdict"] for item in document["requirements"]}
    assert verdicts == {
        "RD under throttle 0.9 <= 0.30": "pass",
        "RD under throttle 0.3 <= 0.30": "fail",
        "DS under clean >= 90": "pass",
    }
    rows = {row["setting"]: row for row in document["summaries"]}
    assert list(rows) == ["clean", "throttle 0.9", "throttle 0.3"]
    assert rows["clean"]["summary"]["ds"] == 100.0
    assert rows["clean"]["rd"] is None
    weak = next(item for item in document["requirements"] if item["verdict"] == "fail")
    assert weak["value"] == rows["throttle 0.3"]["rd"] == pytest.approx(0.64, abs=0.01)
    assert weak["low"] < weak["value"] < weak["high"]
    assert len(document["episodes"]) == 9
    assert {len(episode["trace_digest"]) for episode in document["episodes"]} == {32}
    assert document["episodes"][0]["outcome"] == "completed"


def test_two_workers_write_the_same_file(mixed):
    _, alone = run_json(mixed)
    _, shared = run_json(mixed, "-n2")
    assert stable(shared) == stable(alone)


def test_what_could_not_be_judged_is_an_error_with_its_reason(suite):
    _, document = run_json(suite("RD under throttle 0.9 <= 0.30"), "--drive-sim", "broken")
    (judged,) = document["requirements"]
    assert judged["verdict"] == "error"
    assert judged["value"] is None
    assert "no map" in judged["message"]
    assert {episode["outcome"] for episode in document["episodes"]} == {"infra_error"}
    assert {episode["driving_score"] for episode in document["episodes"]} == {None}


def test_an_infinite_end_of_an_interval_is_null(suite):
    _, document = run_json(suite("RD under throttle 0.3 <= 0.90"), "--drive-routes", "routes.xml:1")
    (judged,) = document["requirements"]
    assert judged["low"] is None
    assert judged["high"] == 1.0


def test_a_file_that_is_there_is_replaced_whole(suite):
    folder = suite("DS under clean >= 90")
    (folder.path / "run.json").write_text("old")
    _, document = run_json(folder)
    assert document["schema"] == 1
    assert [path.name for path in folder.path.glob("run.json*")] == ["run.json"]
