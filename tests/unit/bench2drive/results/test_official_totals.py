"""The totals of official results: equal to the official tools, quirks named, and without them in `fixed`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from official_records import FACTORS, document, motion_step, official_totals, record, write

from pytest_drive_robust.bench2drive.results.official_record import STATUSES
from pytest_drive_robust.bench2drive.results.results_file import read_results
from pytest_drive_robust.cli.main import main

_RATIOS = st.one_of(st.floats(0, 2000).map(lambda x: round(x, 2)), st.sampled_from(["1e+16", "-5.0", "1000.01", "7."]))
_RECORDS = st.builds(
    lambda events, **given: record(**given, **events),
    st.dictionaries(st.sampled_from([*FACTORS, "vehicle_blocked"]), st.integers(0, 2), max_size=2),
    route=st.integers(1, 30).map(str),
    status=st.sampled_from(sorted(STATUSES)),
    completion=st.floats(0, 100).map(lambda x: round(x, 2)),
    share=st.none() | st.floats(0.01, 99.0),
    ratios=st.lists(_RATIOS, max_size=4),
)


def scored(path: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["score", str(path), "--json", *arguments]) == 0
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    return told


def noted(told: dict[str, Any], topic: str) -> str:
    return " | ".join(note for note in told["notes"] if topic in note.partition(":")[0])


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(_RECORDS, min_size=1, max_size=8))
def test_totals_equal_the_official_formulas(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], records: list[dict[str, Any]]
) -> None:
    told = scored(write(tmp_path / "x.json", document(*records)), capsys)
    ds, sr, efficiency = official_totals(records)
    assert told["ds"] == pytest.approx(ds, abs=1e-9)
    assert told["sr"] == pytest.approx(sr, abs=1e-12)
    assert told["efficiency"] == (None if efficiency is None else pytest.approx(efficiency, abs=1e-9))


def test_an_infraction_of_a_kind_that_nobody_knows_is_no_success(tmp_path: Path) -> None:
    other = record("1")
    other["infractions"]["collisions_unicorn"] = ["it was there"]
    path = write(tmp_path / "results.json", document(other, record("2")))
    assert [item.is_success for item in read_results(path).records] == [False, True]


def test_a_folder_of_splits_counts_like_its_merged_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = record("1"), record("2", red_light=1)
    write(tmp_path / "split" / "b_0.json", document(first))
    write(tmp_path / "split" / "b_1.json", document(second))
    (tmp_path / "split" / "b_2.json").write_text("")  # the evaluator died before its first write
    write(tmp_path / "split" / "b_ability.json", {"mean": 0.5})
    merged = {"_checkpoint": {"records": [second, first]}, "driving score": 170 / 220, "success rate": 1 / 220}
    write(tmp_path / "split" / "merged.json", merged)
    parts = scored(tmp_path / "split", capsys)
    whole = scored(tmp_path / "split" / "merged.json", capsys)
    assert parts["ds"] == whole["ds"] == pytest.approx(170 / 220)
    assert "b_2.json" in noted(parts, "files")
    assert "b_ability.json" in noted(parts, "files")
    assert not noted(whole, "files")


def test_missing_duplicate_and_broken_routes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = record("1"), record("2", status="Failed - TickRuntime", completion=40.0)
    broken = record("3", status="Failed - Simulation crashed", completion=10.0)
    path = write(tmp_path / "r.json", document(good, bad, bad, broken, planned=6))
    official, fixed = scored(path, capsys), scored(path, capsys, "--metrics", "fixed")
    assert official["ds"] == pytest.approx((100 + 40 + 40 + 10) / 220)
    assert fixed["ds"] == pytest.approx((100 + 40) / 2)
    assert fixed["sr"] == 0.5
    assert official["duplicates"] == ["RouteScenario_2_rep0"]
    assert official["unscored"] == ["RouteScenario_3_rep0"]
    assert official["missing_count"] == 3
    assert "divided by 220 though there are 4 records" in noted(official, "DS")
    assert "count as routes of their own" in noted(official, "DS")
    assert "fault of the harness" in noted(fixed, "all")


def test_a_route_that_was_driven_again_in_another_file_leaves_none_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    crashed = record("2", status="Failed - Simulation crashed", completion=10.0)
    write(tmp_path / "r" / "all.json", document(record("1"), crashed, planned=2))
    write(tmp_path / "r" / "again.json", document(record("2"), planned=1))
    told = scored(tmp_path / "r", capsys)
    assert (told["missing_count"], told["duplicates"]) == (0, ["RouteScenario_2_rep0"])
    write(tmp_path / "r" / "all.json", document(record("1"), crashed, planned=5))
    assert scored(tmp_path / "r", capsys)["missing_count"] == 3


def test_a_route_file_names_the_missing_routes_and_the_types(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    routes = tmp_path / "routes.xml"
    one = (
        '<route id="{}" town="T"><waypoints><position x="0" y="0" z="0"/><position x="9" y="0" z="0"/></waypoints>'
        '<scenarios><scenario name="a" type="{}"><trigger_point x="0" y="0" z="0" yaw="0"/></scenario></scenarios>'
        "</route>"
    )
    routes.write_text(f"<routes>{one.format(1, 'InvadingTurn')}{one.format(7, 'HighwayExit')}</routes>")
    path = write(tmp_path / "r.json", document(record("1", scenario="")))
    told = scored(path, capsys, "--routes", str(routes))
    assert "does not have" not in noted(told, "DS")
    assert told["missing"] == ["7"]
    assert told["abilities"]["Give_Way"]["value"] == 1.0
    assert told["abilities"]["Merging"]["value"] is None
    assert "DS and SR count them as 0" in noted(told, "abilities")
    write(path, document(record("1"), record("2"), record("3")))
    foreign = "2 records are of routes that the route file does not have (first: '2'); they count in DS and SR, not in"
    for mode in ("bench2drive", "fixed"):
        assert foreign in noted(scored(path, capsys, "--routes", str(routes), "--metrics", mode), "DS")
    write(path, document(record("2"), record("3")))
    assert main(["score", str(path), "--routes", str(routes)]) == 4
    assert "has none of the routes of the results (first: '2')" in capsys.readouterr().err


def test_a_folder_of_logs_that_is_not_there_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "r.json", document(record("1")))
    assert main(["score", str(path), "--metric-dir", str(tmp_path / "nodir")]) == 4
    assert "--metric-dir is " in capsys.readouterr().err


def test_each_quirk_of_efficiency_is_named_only_where_it_changed_the_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = scored(write(tmp_path / "a.json", document(record(ratios=[80.0]))), capsys)
    assert not noted(plain, "efficiency")
    odd = [record("1", ratios=[80.0, 1500.0]), record("2", ratios=[]), record("3", ratios=["2e+02"])]
    told = scored(write(tmp_path / "b.json", document(*odd)), capsys)
    assert told["efficiency"] == pytest.approx((80 + 2) / 2)
    assert "1 values above 1000 %" in noted(told, "efficiency")
    assert "1 routes without a value" in noted(told, "efficiency")
    assert "1 values with a sign or an exponent" in noted(told, "efficiency")
    fixed = scored(tmp_path / "b.json", capsys, "--metrics", "fixed")
    assert fixed["efficiency"] == pytest.approx((790 + 0 + 200) / 3)


def test_comfort_is_the_official_one_and_names_what_made_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    turning = record("1", game_s=2.0)
    write(tmp_path / "r.json", document(turning))
    # Two seconds at 8 m/s: 5 degrees per second are 0.09 radians per second, well within the bound.
    log = {str(n): motion_step(turn_degps=5.0, x_m=0.4 * n) for n in range(40)}
    write(tmp_path / turning["save_name"] / "metric_info.json", log)
    official, fixed = (scored(tmp_path / "r.json", capsys, "--metrics", mode) for mode in ("bench2drive", "fixed"))
    assert (official["comfort"], fixed["comfort"]) == (0.0, 100.0)
    assert "degrees per second" in noted(official, "comfort")
    assert "stands" not in noted(official, "comfort")
    elsewhere = tmp_path / "elsewhere"
    (tmp_path / turning["save_name"]).rename(tmp_path / "moved")
    elsewhere.mkdir()
    (tmp_path / "moved").rename(elsewhere / f"split0_{turning['save_name']}")
    assert scored(tmp_path / "r.json", capsys)["comfort"] is None
    found = scored(tmp_path / "r.json", capsys, "--metric-dir", str(elsewhere))
    assert found["comfort"] == 0.0
    assert "before the save_name" in noted(found, "comfort")


def test_steps_are_taken_as_written_officially_and_in_order_otherwise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    item = record("1", game_s=2.0)
    write(tmp_path / "r.json", document(item))
    rising = {str(n): motion_step(forward=0.05 * n, x_m=0.4 * n) for n in range(40)}
    shuffled = dict(sorted(rising.items()))
    write(tmp_path / item["save_name"] / "metric_info.json", shuffled)
    assert scored(tmp_path / "r.json", capsys, "--metrics", "fixed")["comfort"] == 100.0
    assert scored(tmp_path / "r.json", capsys)["comfort"] < 100.0


def test_the_duration_tells_how_far_apart_an_agent_was_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # 2.4 m/s2 in six calls: 8 m/s3 when they are a tick apart, 2 m/s3 when they are four.
    log = {str(n): motion_step(forward=0.4 * n - 1.2, x_m=0.4 * n) for n in range(7)}
    for game_s, comfort in ((0.35, 0.0), (1.4, 100.0)):
        item = record("1", game_s=game_s)
        write(tmp_path / "r.json", document(item))
        write(tmp_path / item["save_name"] / "metric_info.json", log)
        assert scored(tmp_path / "r.json", capsys, "--metrics", "fixed")["comfort"] == comfort
        assert scored(tmp_path / "r.json", capsys)["comfort"] == 100.0  # 4 m/s3: the official tool never asks


def test_traffic_signs_is_a_range_where_only_a_map_could_tell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = [
        record("1", scenario="T_Junction"),
        record("2", scenario="T_Junction", status="Failed - TickRuntime", completion=60.0),
        record("3", scenario="T_Junction", status="Failed - TickRuntime", completion=60.0, red_light=1),
        {**record("4", scenario="T_Junction", collisions_vehicle=1), "drive_robust": {"junction_passed": True}},
    ]
    told = scored(write(tmp_path / "r.json", document(*records)), capsys)
    assert told["abilities"]["Traffic_Signs"] == {"value": None, "low": 0.5, "high": 0.75, "routes": 4}
    assert "only the map" in noted(told, "Traffic_Signs")


def test_the_repetition_that_the_merge_tool_puts_first_counts_in_abilities(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = record(repetition=0, status="Failed - TickRuntime", completion=40.0)
    second = record(repetition=1)
    write(tmp_path / "parts" / "a.json", document(first, second))
    merged = {"_checkpoint": {"records": sorted([first, second], key=lambda item: item["route_id"], reverse=True)}}
    for path in (tmp_path / "parts", write(tmp_path / "merged.json", merged)):
        assert scored(path, capsys)["abilities"]["Overtaking"]["value"] == 1.0
        assert scored(path, capsys, "--metrics", "fixed")["abilities"]["Overtaking"]["value"] == 0.5


def test_the_table_shows_footnotes_beside_the_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "r.json", document(record("1\x1b[31m", red_light=1)))
    assert main(["score", str(path)]) == 0
    out = capsys.readouterr().out
    assert "DS                0.3182 [1]" in out
    assert "[1] DS, SR: divided by 220" in out
    assert "\x1b" not in out


def test_scores_of_other_rules_are_noticed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = record("1", red_light=1)
    other["scores"]["score_composed"] = 55.0
    told = scored(write(tmp_path / "r.json", document(other)), capsys)
    assert "do not follow from their infractions" in noted(told, "DS")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", "not valid JSON"),
        ("[1, 2]", "'_checkpoint' with 'records'"),
        ('{"_checkpoint": {"records": []}}', "A score of nothing is not 0"),
        ('{"_checkpoint": {"records": [NaN]}}', "NaN is not a number"),
        ("[" * 100_000, "not valid JSON"),
        (json.dumps(document({**record(), "status": "Complete"})), "Did you mean 'Completed'?"),
        (json.dumps(document({**record(), "route_id": "101"})), "expected 'RouteScenario_<id>_rep<number>'"),
        (json.dumps(document({**record(), "scores": {"score_route": True}})), "score_route"),
    ],
)
def test_what_is_no_result_file_is_one_sentence_and_code_4(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, expected: str
) -> None:
    path = tmp_path / "r.json"
    path.write_text(content)
    assert main(["score", str(path)]) == 4
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize("name", ["nothing", "x" * 5000])
def test_a_path_without_results_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert main(["score", str(tmp_path / name)]) == 4
    assert "cannot be read" in capsys.readouterr().err
    (tmp_path / "empty" / "below").mkdir(parents=True)
    write(tmp_path / "empty" / "below" / "r.json", document(record()))
    assert main(["score", str(tmp_path / "empty")]) == 4
    assert "below" in capsys.readouterr().err


def test_what_a_part_that_died_had_before_it_is_not_known(tmp_path: Path) -> None:
    for number in (0, 1):
        write(tmp_path / f"eval_{number}.json", document(record(str(number)), planned=1))
    assert read_results(tmp_path).planned == 2
    (tmp_path / "eval_2.json").touch()
    results = read_results(tmp_path)
    assert results.planned is None
    assert [path.name for path in results.skipped] == ["eval_2.json"]
    assert [(file.path.name, file.planned) for file in results.unfinished] == [("eval_2.json", None)]


def test_a_file_that_holds_fewer_than_planned_is_unfinished_whatever_lies_beside_it(tmp_path: Path) -> None:
    write(tmp_path / "eval_0.json", document(record("0"), record("0", repetition=1), planned=2))
    write(tmp_path / "eval_1.json", document(record("1"), record("1"), planned=2))
    write(tmp_path / "notes.json", {"by": "us"})
    results = read_results(tmp_path)
    (file,) = results.unfinished
    assert (file.path.name, file.held, file.planned) == ("eval_1.json", 1, 2)
    assert str(file).endswith("eval_1.json' holds 1 of 2 episodes, and 1 more records of the same ones")
