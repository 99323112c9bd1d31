"""Result files of any content: a number that is right, or one sentence; never a traceback, never a hang."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from official_fuzzing import ANY, FUZZ, places, replaced, try_everything
from official_records import document, record

from pytest_drive_robust.bench2drive.results.planned_routes import add_planned
from pytest_drive_robust.bench2drive.results.results_file import read_results

_WHOLE = document(record("1", share=12.34, red_light=1), record("2", status="Failed - TickRuntime"), planned=3)
_PLACES = places(_WHOLE)


@FUZZ
@given(st.sampled_from(_PLACES[1:]), st.just(...) | ANY)
def test_a_result_file_with_anything_anywhere(tmp_path: Path, place: tuple[Any, ...], new: object) -> None:
    path = tmp_path / "r.json"
    path.write_text(json.dumps(replaced(_WHOLE, place, new)), encoding="utf-8")
    try_everything(path)


def test_a_planned_route_whose_record_is_a_fault_of_the_harness_is_there_without_a_score(tmp_path: Path) -> None:
    crashed = record("2", status="Failed - Simulation crashed")
    for route in (record("1"), crashed):
        (tmp_path / f"{route['route_id']}.json").write_text(json.dumps(document(route, planned=1)), encoding="utf-8")
    add_planned(tmp_path, ["1", "2", "3"])
    results = read_results(tmp_path)
    assert (results.missing, results.planned) == (("3",), 3)
    assert [found.is_harness_error for found in results.records] == [False, True]
