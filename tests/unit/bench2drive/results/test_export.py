"""A run in the official schema and back: official formulas print our numbers, and nothing is lost."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from official_records import LISTS, official_totals
from result_factory import crashed_simulation, infraction, make_result, trace_of

from pytest_drive_robust.bench2drive.results.export import export_run
from pytest_drive_robust.bench2drive.results.results_source import ResultsSource
from pytest_drive_robust.cli.main import main
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult, Injection, Reception, Touch
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.metrics.summary import summarize
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.regression.document import json_text
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.simulators.embedded.route_xml import load_routes
from pytest_drive_robust.store.record_files import write_episode

_KINDS = [kind for kind in InfractionKind if kind not in (InfractionKind.MIN_SPEED, InfractionKind.OUTSIDE_LANES)]
_EVENTS = st.builds(
    Infraction,
    st.sampled_from(_KINDS) | st.just(InfractionKind.OUTSIDE_LANES),
    st.integers(0, 4000),
    st.text(max_size=10),
    st.floats(-1e4, 1e4),
    st.floats(-1e4, 1e4),
    st.floats(0.0, 100.0),
)
_ENDS = [end for end in End if end.name in ("COMPLETED", "BLOCKED", "TICK_CAP", "STUCK", "AGENT_CRASHED", "DEVIATED")]


def drive(ticks: int, wobble: float) -> Any:
    t = np.arange(ticks)
    return trace_of(
        ticks,
        x_m=0.4 * t,
        y_m=np.sin(0.1 * t),
        yaw_rad=0.01 * t - 0.5,
        speed_mps=8.0,
        forward_mps2=2.0 * np.sin(wobble * t),
        right_mps2=0.5,
        yaw_rate_radps=0.015 * np.cos(wobble * t),
        throttle=0.3,
        progress_m=0.4 * t,
    )


def exported(tmp_path: Path, results: Sequence[EpisodeResult], *, stored: bool = True) -> Path:
    """The folder of the only result set."""
    episodes = {f"k{number}": result for number, result in enumerate(results)}
    document = json.loads(json_text(run_as_json(run_of(episodes))))
    (written,) = export_run(document, tmp_path / "out", find=episodes.get if stored else lambda key: None)
    return written.folder


def run_of(episodes: dict[str, EpisodeResult]) -> RunResult:
    return RunResult(options=RunOptions(), rows=(), judged=(), episodes=episodes)


def imported(folder: Path, result: EpisodeResult) -> EpisodeResult:
    source = ResultsSource.read(result.episode.setting, folder)
    route = next(route for route in source.routes if route.id == result.episode.route_id)
    return source.episode(result.episode, route)


def scored(path: Path, capsys: pytest.CaptureFixture[str], mode: str) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["score", str(path), "--json", "--metrics", mode]) == 0
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    return told


def full_result(route_id: str = "7", **given: Any) -> EpisodeResult:
    return replace(
        make_result(
            route_id,
            infractions=[
                infraction(InfractionKind.RED_LIGHT),
                infraction(InfractionKind.OUTSIDE_LANES, share_pct=1 / 3),
            ],
            speed_ratios_pct=[100.0 / 3.0, 2e-7, 1e17],
            trace=drive(50, 0.3),
            junction_passed=True,
            **given,
        ),
        schedule=(Injection("latency", "control", 3, 17),),
        inference_s=(0.1, 1 / 3),
        privileged=True,
        reception=Reception(("front",), ("camera",), 50, (Touch("control", 10, 3),)),
    )


def test_nothing_is_lost_on_the_way_there_and_back(tmp_path: Path) -> None:
    result = full_result(setting="200 ms latency")
    back = imported(exported(tmp_path, [result]), result)
    assert back.trace.digest == result.trace.digest
    assert replace(back, trace=result.trace) == result


def test_without_stored_ticks_all_but_the_ticks_comes_back(tmp_path: Path) -> None:
    result = replace(full_result(), inference_s=())
    back = imported(exported(tmp_path, [result], stored=False), result)
    assert len(back.trace.rows) == 0
    assert replace(back, trace=result.trace) == result


def test_official_readers_find_the_official_schema(tmp_path: Path) -> None:
    results = [make_result("1"), make_result("2", end=End.STUCK), crashed_simulation("3")]
    folder = exported(tmp_path, [*results, make_result("4", speed_ratios_pct=())])
    document = json.loads((folder / "results.json").read_text())
    records = document["_checkpoint"]["records"]
    assert [item["status"] for item in records] == [
        "Completed",
        "Failed - Stuck (early stop)",
        "Failed - Simulation crashed",
        "Perfect",
    ]
    assert all(sorted(item["infractions"]) == sorted(LISTS) for item in records)
    assert document["_checkpoint"]["progress"] == [4, 4]
    assert document["entry_status"] == "Crashed"
    assert len(document["values"]) == len(document["labels"]) == 15
    assert records[2]["scores"]["score_composed"] == 0.0
    log = json.loads((folder / records[0]["save_name"] / "metric_info.json").read_text())
    assert list(log) == [str(step) for step in range(40)]
    assert set(log["0"]) == {
        "acceleration", "angular_velocity", "forward_vector", "right_vector", "location", "rotation",
    }  # fmt: skip


@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.lists(
        st.tuples(
            st.sampled_from(_ENDS),
            st.floats(0.0, 100.0),
            st.lists(_EVENTS, max_size=4),
            st.lists(st.floats(0.0, 1e7), max_size=4),
            st.integers(0, 70),
            st.floats(0.0, 1.0),
        ),
        min_size=1,
        max_size=4,
    )
)
def test_official_formulas_print_our_numbers(
    tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str], drawn: list[Any]
) -> None:
    results = [
        make_result(
            str(number),
            scenario=["T_Junction", "HighwayExit"][number % 2],
            end=end,
            completion_pct=100.0 if end is End.COMPLETED else completion,
            infractions=events,
            speed_ratios_pct=ratios,
            trace=drive(ticks, wobble),
            junction_passed=completion > 50.0,
        )
        for number, (end, completion, events, ratios, ticks, wobble) in enumerate(drawn, start=1)
    ]
    folder = exported(tmp_path_factory.mktemp("run"), results)
    ours = summarize(results)
    records = json.loads((folder / "results.json").read_text())["_checkpoint"]["records"]
    ds, sr, efficiency = official_totals(records)
    assert (ds * 220 / len(results), sr * 220 / len(results)) == (pytest.approx(ours.ds), pytest.approx(ours.sr))
    assert efficiency == (None if ours.efficiency is None else pytest.approx(ours.efficiency))
    official, fixed = scored(folder, capsys, "bench2drive"), scored(folder, capsys, "fixed")
    assert official["comfort"] == (None if ours.comfort is None else pytest.approx(ours.comfort))
    assert {name: rate["value"] for name, rate in official["abilities"].items()} == pytest.approx(dict(ours.abilities))
    assert (fixed["ds"], fixed["sr"]) == (pytest.approx(ours.ds), pytest.approx(ours.sr))
    assert fixed["efficiency"] == pytest.approx(summarize(results, mode="fixed").efficiency)
    for result in results:
        assert replace(imported(folder, result), trace=result.trace) == result


def test_the_map_for_the_ability_tool_has_its_junction_where_our_simulator_saw_it(tmp_path: Path) -> None:
    results = [make_result("1", junction_passed=True), make_result("2", junction_passed=False)]
    folder = exported(tmp_path, results)
    routes = {route.id: route for route in load_routes(folder / "routes.xml")}
    assert [routes[name].scenario.type for name in ("1", "2")] == ["ParkedObstacle", "ParkedObstacle"]
    length_m = routes["1"].waypoints[-1].x_m - routes["1"].waypoints[0].x_m
    shares = {}
    for name, route in routes.items():
        path = (
            tmp_path / "out" / "carla" / "CarlaUE4" / "Content" / "Carla" / "Maps" / "OpenDrive" / f"{route.town}.xodr"
        )
        roads = ElementTree.parse(path).getroot().findall("road")
        (junction,) = (road for road in roads if road.get("junction") != "-1")
        begin_m = float(junction.find("planView/geometry").get("x"))  # type: ignore[union-attr,arg-type]
        assert sum(float(road.get("length") or 0.0) for road in roads) == pytest.approx(length_m + 2.0)
        shares[name] = (begin_m + 8.0) / length_m
    assert shares["1"] < 0.02  # any share of the route that a car drove is beyond it
    assert shares["2"] > 1.0  # nothing is


def test_an_edited_record_is_not_believed(tmp_path: Path) -> None:
    result = full_result()
    folder = exported(tmp_path, [result])
    path = folder / "results.json"
    document = json.loads(path.read_text())
    document["_checkpoint"]["records"][0]["infractions"]["red_light"] = []
    path.write_text(json.dumps(document))
    with pytest.raises(UsageError, match="edited after its export"):
        imported(folder, result)


def test_a_damaged_episode_file_is_not_believed(tmp_path: Path) -> None:
    result = full_result()
    folder = exported(tmp_path, [result])
    (path,) = folder.glob("*/drive_robust.episode")
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(UsageError, match="Export the run again, or remove it"):
        imported(folder, result)
    path.unlink()
    assert imported(folder, result).infractions == result.infractions


def test_an_episode_file_that_tells_of_another_drive_is_not_believed(tmp_path: Path) -> None:
    result = full_result()
    folder = exported(tmp_path, [result])
    (path,) = folder.glob("*/drive_robust.episode")
    path.unlink()
    write_episode(path, replace(result, episode=replace(result.episode, setting="occlusion 0.8")))
    assert imported(folder, result).episode == result.episode
    path.unlink()
    write_episode(path, replace(result, infractions=()))
    with pytest.raises(UsageError, match="edited after its export"):
        imported(folder, result)


def test_each_agent_setting_and_seed_is_a_result_set_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    episodes = {}
    for setting in ("clean", "200 ms latency"):
        for seed in (0, 1):
            result = make_result("101", setting=setting, seed=seed)
            episodes[f"{setting[0]}{seed}"] = result
    (tmp_path / "run.json").write_text(json_text(run_as_json(run_of(episodes))))
    (tmp_path / "kept").mkdir()
    write_episode(tmp_path / "kept" / "c0.episode", episodes["c0"])
    out = tmp_path / "out"
    assert main(["export", str(tmp_path / "run.json"), str(out), "--episodes", str(tmp_path / "kept")]) == 0
    said = capsys.readouterr().out
    assert sorted(str(path.parent.relative_to(out)) for path in out.rglob("results.json")) == [
        "driver/200-ms-latency/seed0",
        "driver/200-ms-latency/seed1",
        "driver/clean/seed0",
        "driver/clean/seed1",
    ]
    assert len(list(out.rglob("metric_info.json"))) == 1
    assert "1 without metric_info.json" in said
    assert main(["export", str(tmp_path / "run.json"), str(out)]) == 4
    assert "there already and not empty" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("results", "expected"),
    [
        ([make_result("a_b")], "official tools cut ids at '_'"),
        ([make_result("1"), make_result("1")], "two routes with the id '1'"),
        ([], "no episode to export"),
    ],
)
def test_what_the_schema_cannot_hold_is_refused(tmp_path: Path, results: list[EpisodeResult], expected: str) -> None:
    with pytest.raises(UsageError, match=expected):
        exported(tmp_path, results)
    assert not (tmp_path / "out").exists()


def test_a_damaged_run_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = json.loads(json_text(run_as_json(run_of({"k": make_result("1")}))))
    document["episodes"][0]["route_completion_pct"] = "100"
    (tmp_path / "run.json").write_text(json.dumps(document))
    assert main(["export", str(tmp_path / "run.json"), str(tmp_path / "out")]) == 4
    assert 'episodes[0].route_completion_pct must be number or null, not "100"' in capsys.readouterr().err
    assert main(["export", str(tmp_path / "run.json"), str(tmp_path / "out"), "--format", "bench2driv"]) == 4
    assert "Did you mean 'bench2drive'?" in capsys.readouterr().err
