"""What a run's document says about each agent that it drove."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from result_factory import make_result

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.regression.document import read_document, snapshot_of
from pytest_drive_robust.regression.fingerprint import Fingerprint, mismatches
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.store.events import EpisodesNeeded, Spared, Used


def fingerprints(torch: str, machine: str) -> dict[str, Fingerprint]:
    """Return those of a portable and of a learned agent, driven in one run."""
    learned = {"simulator": "embedded 2", "torch": torch, "machine torch": machine, "python": "3.11"}
    results = {
        "portable": make_result(agent="portable", versions={"simulator": "embedded 2"}),
        "learned": make_result(agent="learned", versions=learned),
    }
    needed = [EpisodesNeeded(agent, "dev10", "clean", (0,), (agent,), ()) for agent in results]
    run = RunResult.of(RunOptions(), [*needed, Used(tuple(results))], results.get, versions={"numpy": torch})
    cells = snapshot_of(run_as_json(run), label="run").cells
    return {agent: cell.routes["1"].fingerprint for (agent, _), cell in cells.items()}


def test_an_agent_is_compared_by_what_its_own_episodes_depend_on() -> None:
    before, after = fingerprints("2.4", "aa"), fingerprints("2.5", "bb")
    assert mismatches(before["portable"], after["portable"], agent="portable") == ()
    told = [item.text for item in mismatches(before["learned"], after["learned"], agent="learned")]
    assert len(told) == 2
    assert "torch was 2.4 and is 2.5" in told
    assert any("the torch of this machine gives other bits" in text for text in told)


@pytest.mark.parametrize(
    ("specs", "told"),
    [
        (("day.xml",), "day.xml"),
        (("day.xml", "night.xml"), ""),
        (("dev10", "night.xml"), ""),
        (("dev10", "101,201"), "dev10"),
    ],
)
def test_no_file_is_named_for_routes_of_several(specs: tuple[str, ...], told: str) -> None:
    results = {spec: make_result(str(number)) for number, spec in enumerate(specs)}
    needed = [EpisodesNeeded("driver", spec, "clean", (0,), (spec,)) for spec in specs]
    run = RunResult.of(RunOptions(), [*needed, Used(specs)], results.get, versions={})
    (cell,) = snapshot_of(run_as_json(run), label="run").cells.values()
    assert len(cell.routes) == len(specs)
    assert cell.routes_spec == told


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"summaries": 5}, "summaries must be array, not 5"),
        ({"episodes": None}, "episodes must be array, not null"),
        ({"settings": []}, "settings must be object, not []"),
        ({"settings": {"simulator": "fake"}}, "settings lacks 'metrics'"),
        ({"stored": ["today"]}, 'stored must be object or null, not ["today"]'),
        ({"fingerprint": "d0"}, 'fingerprint must be object, not "d0"'),
        ({"fingerprint": {"agents": {}, "routes": {"1": 7}}}, "fingerprint.routes.1 must be string, not 7"),
        ({"requirements": None}, "requirements must be array, not null"),
        ({"notes": ["yes", 5]}, "notes[1] must be string, not 5"),
        ({"episodes": [{"key": "k", "ticks": 1}]}, "episodes[0] lacks 'agent'"),
        ({"ended_early": 0}, "ended_early must be boolean, not 0"),
        ({"stopped_tests": [1]}, "stopped_tests[0] must be string, not 1"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_a_file_with_something_else_where_runs_have_their_parts_is_no_run(
    tmp_path: Path, changed: dict[str, object], told: str
) -> None:
    settings = {"simulator": "fake", "metrics": "bench2drive"}
    run = {"schema": 1, "settings": settings, "summaries": [], "episodes": []}
    (tmp_path / "run.json").write_text(json.dumps(run))
    assert read_document(tmp_path / "run.json") == run
    (tmp_path / "run.json").write_text(json.dumps({**run, **changed}))
    with pytest.raises(UsageError, match=re.escape(f"run.json' is damaged: {told}.")):
        read_document(tmp_path / "run.json")


def test_a_damaged_run_is_named_as_well_after_a_nested_session_has_imported_the_checker_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.json").write_text('{"schema": 1, "settings": {}, "summaries": 5, "episodes": []}')
    for _ in range(2):
        with pytest.raises(UsageError, match="is damaged"):
            read_document(tmp_path / "run.json")
        for name in [name for name in sys.modules if name.partition(".")[0] == "fastjsonschema"]:
            monkeypatch.delitem(sys.modules, name)


def test_a_number_that_json_does_not_have_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text('{"schema": 1, "settings": {}, "summaries": [], "episodes": [NaN]}')
    with pytest.raises(UsageError, match=r"run\.json' is not valid JSON: NaN is not a number in JSON\."):
        read_document(tmp_path / "run.json")


@pytest.mark.parametrize(
    ("field", "given", "told"),
    [
        ("driving_score", "high", 'must be number or null, not "high"'),
        ("driving_score", 101, "must be smaller than or equal to 100, not 101"),
        ("seed", 0.5, "must be integer, not 0.5"),
        ("outcome", "done", "must be one of ['completed', 'failed', 'agent_error', 'infra_error'], not \"done\""),
        ("reception", {"cameras": []}, None),
    ],
    ids=str,
)
def test_the_place_of_what_was_edited_is_named(tmp_path: Path, field: str, given: object, told: str | None) -> None:
    results = {"a": make_result("1"), "b": make_result("2")}
    needed = [EpisodesNeeded("driver", "dev10", "clean", (0,), tuple(results), ())]
    document: Any = run_as_json(RunResult.of(RunOptions(), [*needed, Used(tuple(results))], results.get, versions={}))
    document["episodes"][1][field] = given
    (tmp_path / "run.json").write_text(json.dumps(document))
    said = f"episodes[1].{field} " + (told or "lacks 'consumes'")
    with pytest.raises(UsageError, match=re.escape(f"run.json' is damaged: {said}.")):
        read_document(tmp_path / "run.json")


def test_a_run_that_is_nested_so_deeply_that_it_can_just_be_read_is_refused_in_a_sentence(tmp_path: Path) -> None:
    for depth in range(sys.getrecursionlimit()):
        nested = "[" * depth + "]" * depth
        (tmp_path / "run.json").write_text(
            f'{{"schema": 1, "settings": {nested or 1}, "summaries": [], "episodes": []}}'
        )
        with pytest.raises(UsageError, match=r"settings must be object, not |it is nested too deeply"):
            read_document(tmp_path / "run.json")


def test_brackets_without_an_end_are_no_run(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("[" * 100_000)
    with pytest.raises(UsageError, match=r"run\.json.* is not valid JSON"):
        read_document(tmp_path / "run.json")


@pytest.mark.parametrize("order", [1, -1])
def test_what_one_set_of_routes_lacks_is_told_whatever_the_other_sets_hold(order: int) -> None:
    results = {"a": make_result("1"), "b": make_result("2")}
    needed = [
        EpisodesNeeded("driver", "dev10", "clean", (0,), ("a", "lost"), ()),
        EpisodesNeeded("driver", "full", "clean", (0,), ("b",), ()),
    ]
    run = RunResult.of(RunOptions(), [*needed[::order], Used(("a", "b"))], results.get, versions={})
    (cell,) = snapshot_of(run_as_json(run), label="run").cells.values()
    assert sorted(cell.routes) == ["1", "2"]
    assert cell.broken == ("1 episode was not driven, as the run ended before, or a verdict was an error",)


def test_what_a_verdict_did_without_is_told_of_routes_with_several_seeds_too() -> None:
    results = {f"{route} {seed}": make_result(route, seed=seed) for route in "12" for seed in (0, 1)}
    keys = tuple(results)
    needed = EpisodesNeeded("driver", "dev10", "clean", (0, 1), keys, ())
    run = RunResult.of(RunOptions(), [needed, Used(keys[:2]), Spared(keys[2:])], results.get, versions={})
    (cell,) = snapshot_of(run_as_json(run), label="run").cells.values()
    assert cell.stopped == ("1 of 2 routes of dev10",)
    assert cell.broken == ()
