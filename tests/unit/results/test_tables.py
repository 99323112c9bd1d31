"""The tables of a run that nobody drove: what stands in which row."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from result_factory import crashed_simulation, infraction, make_result, trace_of
from stored_runs import SETTING, run_of

from pytest_drive_robust.domain.outcome import InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult, Given
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.results.run import Run
from pytest_drive_robust.results.table_files import write_csv_tables
from pytest_drive_robust.results.tables import columns_of
from pytest_drive_robust.store.events import Judged


def late(**given: object) -> EpisodeResult:
    return make_result("101", setting=SETTING, **given)  # type: ignore[arg-type]


def test_a_tick_is_over_one_tick_after_it_began_and_has_a_row_in_every_column() -> None:
    clean, perturbed = (
        make_result("101", trace=trace_of(2, x_m=[1.0, 2.0])),
        late(trace=trace_of(3, x_m=[3.0, 4.0, 5.0])),
    )
    ticks = columns_of(run_of(clean, perturbed), "ticks")
    assert {len(values) for values in ticks.values()} == {5}
    assert ticks["tick"].tolist() == [0, 1, 0, 1, 2]  # type: ignore[attr-defined]
    assert list(ticks["time_s"]) == pytest.approx([0.05, 0.10, 0.05, 0.10, 0.15])
    assert list(ticks["setting"]) == ["clean"] * 2 + [SETTING] * 3
    assert list(ticks["key"]) == ["0"] * 2 + ["1"] * 3
    assert list(ticks["x_m"]) == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_an_episode_that_was_renamed_in_the_document_is_not_the_stored_one() -> None:
    run = run_of(make_result("101"))
    renamed = {**run.records.document["episodes"][0], "agent": "other"}
    document = {**run.records.document, "episodes": [renamed]}
    read = Run.of(RunRecords.of(document, {"0": run.episodes[0]}.get, default_registry(), label="edited"))
    assert list(columns_of(read, "episodes")["agent"]) == ["other"]


def test_what_was_told_stands_in_its_tick_and_what_was_told_after_the_last_one_nowhere() -> None:
    rows = np.array([[0, 7.0, 8.0, 0.5, 9.0], [2, 70.0, 80.0, 0.6, 90.0], [3, 1.0, 1.0, 1.0, 1.0]], np.float32)
    told = replace(late(trace=trace_of(3)), given=Given(rows))
    ticks = columns_of(run_of(told, make_result("101", trace=trace_of(1))), "ticks")
    nan = math.nan
    for name, values in (("told_x_m", [7.0, nan, 70.0, nan]), ("told_y_m", [8.0, nan, 80.0, nan])):
        assert np.array_equal(ticks[name], values, equal_nan=True)
    assert np.allclose(ticks["told_heading_rad"], [0.5, nan, 0.6, nan], equal_nan=True)
    assert np.array_equal(ticks["told_speed_mps"], [9.0, nan, 90.0, nan], equal_nan=True)


def test_an_infraction_has_the_tick_and_the_second_of_the_table_of_ticks_and_none_where_nobody_told() -> None:
    events = [infraction(InfractionKind.RED_LIGHT, second=second) for second in (1.5, 0.0)]
    run = run_of(late(infractions=events, dt_s=0.05, trace=trace_of(40)))
    infractions, ticks = columns_of(run, "infractions"), columns_of(run, "ticks")
    assert (infractions["tick"], infractions["time_s"]) == ([29, None], [1.5, None])
    (row,) = np.flatnonzero(ticks["tick"] == 29)
    assert ticks["time_s"][row] == infractions["time_s"][0]
    assert (infractions["setting"], infractions["kind"]) == ([SETTING] * 2, [InfractionKind.RED_LIGHT.value] * 2)


def test_an_episode_names_its_clean_twin_and_one_that_the_simulator_broke_has_no_metrics() -> None:
    run = run_of(make_result("101"), late(), crashed_simulation("102"), make_result("103", trace=trace_of(0)))
    episodes = columns_of(run, "episodes")
    assert episodes["clean_key"] == [None, "0", None, None]
    assert [value is None for value in episodes["efficiency_pct"]] == [False, False, True, False]
    assert [value is None for value in episodes["comfort_pct"]] == [False, False, True, True]
    assert episodes["success"][:3] == [True, True, None]
    assert episodes["end_detail"][2] == "the server went away"


def test_the_seeds_of_a_requirement_are_one_text() -> None:
    asked = ("test.py::test_it", "DS under clean >= 1", "driver", "dev10", (0, 1, 2), "DS", "clean", ">=", 1.0)
    judged = Judged(*asked, verdict="pass")
    table = columns_of(replace(run_of(make_result("101")), requirements=(judged,)), "requirements")
    assert (table["seeds"], table["verdict"]) == (["0 1 2"], ["pass"])


def test_a_run_is_selected_by_each_part_of_an_episodes_name() -> None:
    run = run_of(make_result("101"), late(), make_result("101", seed=1), make_result("102", agent="other"))
    chosen = {
        name: [run.key(result) for result in run.select(**{name: value}).episodes]  # type: ignore[arg-type]
        for name, value in (("agent", "other"), ("setting", SETTING), ("route_id", "102"), ("seed", 1))
    }
    assert chosen == {"agent": ["3"], "setting": ["1"], "route_id": ["3"], "seed": ["2"]}
    assert [run.key(result) for result in run.select(agent="driver", seed=0, setting="clean").episodes] == ["0"]


@pytest.mark.parametrize("count", [0, 1, 100, 101, 200])
def test_many_episodes_are_written_in_pieces_and_none_is_lost_or_written_twice(tmp_path: Path, count: int) -> None:
    run = run_of(*(make_result("101", seed=seed, trace=trace_of(2)) for seed in range(count or 1)))
    list(write_csv_tables(run if count else replace(run, episodes=()), tmp_path))
    with (tmp_path / "ticks.csv").open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        assert [(row["seed"], row["tick"]) for row in reader] == [(str(n), t) for n in range(count) for t in "01"]
        assert reader.fieldnames is not None
        assert "told_x_m" in reader.fieldnames
