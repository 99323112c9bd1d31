"""The folder of pages: what it holds, that it is safe to open, what it writes over."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from full_disk import full_disk
from report_pages import SETTING, data_of, document, evidence, motion_of, records
from result_factory import FULL, crashed_simulation, infraction, make_result, scored, trace_of

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.result import Given, Reception, Touch
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Terms
from pytest_drive_robust.regression.document import snapshot_of
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.pages import folder as pages_folder
from pytest_drive_robust.report.pages.folder import MARK, check_folder, write_pages
from pytest_drive_robust.report.pages.motion import UNTOUCHED, motion_text
from pytest_drive_robust.report.run_records import RunRecords
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.runner.cache_key.identity import route_digest
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.events import EpisodesNeeded, Judged, Used

EVIL = '</script><img src=x onerror="alert(1)">\u2028'


def test_a_folder_holds_a_page_scripts_styles_and_data(tmp_path):
    page = write_pages(tmp_path / "report", records(make_result("101"), make_result("301")))
    assert page == tmp_path / "report" / "index.html"
    text = page.read_text(encoding="utf-8")
    names = re.findall(r'(?:src|href)="([^"#]+\.(?:js|css))"', text)
    assert {name for name in names if not (tmp_path / "report" / name).is_file()} == set()
    assert {path.name for path in (tmp_path / "report" / "data").iterdir()} == {"run.js", "route-0.js", "route-1.js"}


def test_the_page_loads_nothing_from_elsewhere_and_runs_no_script_of_its_own(tmp_path):
    text = write_pages(tmp_path, records(make_result("101"))).read_text(encoding="utf-8")
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]+)"', text)
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    assert "http" not in policy
    assert "//" not in text.replace("<!doctype html>", "")
    assert re.findall(r"<script(?![^>]*\bsrc=)", text) == []
    assert re.findall(r"\son\w+=|style=", text) == []


def test_scripts_put_in_what_a_run_says_as_text_only(tmp_path):
    write_pages(tmp_path, records(make_result("101")))
    sources = "".join(path.read_text(encoding="utf-8") for path in (tmp_path / "static").glob("*.js"))
    for way in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function", "srcdoc"):
        assert way not in sources
    assert "http://" not in sources.replace("http://www.w3.org/2000/svg", "")


def test_names_and_texts_of_a_run_cannot_become_markup(tmp_path):
    evil = replace(make_result("101", agent=EVIL, scenario=EVIL), end_detail=EVIL)
    judged = Judged("t", EVIL, EVIL, "one-per-scenario", (0,), "DS", "clean", ">=", 1.0, "fail", 0.0, 0.0, 0.0, 1)
    label = RunRecords.of(*document(evil, judged=[judged]), default_registry(), label=EVIL)
    text = write_pages(tmp_path, label).read_text(encoding="utf-8")
    assert "<img" not in text
    raw = (tmp_path / "data" / "run.js").read_bytes()
    assert b"<" not in raw
    assert raw.isascii()  # U+2028 ends a line in old browsers
    assert EVIL in data_of(tmp_path)["episodes"]["words"]


def test_names_that_are_no_unicode_are_no_reason_to_fail(tmp_path):
    odd = replace(make_result("101"), end_detail="\udcff")
    write_pages(tmp_path, RunRecords.of(*document(odd), default_registry(), label="a\udcff"))
    assert r"a\udcff" in (tmp_path / "index.html").read_text(encoding="utf-8")


def test_what_is_no_number_is_null(tmp_path):
    hit = replace(infraction(InfractionKind.COLLISION_VEHICLE), x_m=float("nan"))
    result = make_result("101", infractions=[hit], trace=trace_of(40, speed_mps=float("nan"), x_m=float("inf")))
    write_pages(tmp_path, records(result))
    assert data_of(tmp_path)["episodes"]["events"][0][0][3:] == [None, None]


def test_a_former_report_is_written_over_and_nothing_else(tmp_path):
    folder = tmp_path / "report"
    write_pages(folder, records(make_result("101"), make_result("301")))
    (folder / "mine.txt").write_text("kept")
    write_pages(folder, records(make_result("101")))
    assert {path.name for path in (folder / "data").iterdir()} == {"run.js", "route-0.js"}
    assert (folder / "mine.txt").read_text() == "kept"
    (folder / MARK).unlink()
    with pytest.raises(UsageError, match="holds other things") as refused:
        write_pages(folder, records(make_result("101")))
    assert str(folder / "report") in str(refused.value)  # what is proposed can be made from the current folder


def test_two_runs_that_write_one_folder_at_the_same_time_leave_one_report(tmp_path, monkeypatch):
    other = replace(records(make_result("101"), make_result("301")), label="the other run")
    copy = pages_folder._copy_static

    def meanwhile(folder):
        monkeypatch.setattr(pages_folder, "_copy_static", copy)
        write_pages(tmp_path, other)
        copy(folder)

    monkeypatch.setattr(pages_folder, "_copy_static", meanwhile)
    page = write_pages(tmp_path, records(make_result("101")))
    assert "<title>a run - " in page.read_text(encoding="utf-8")
    assert data_of(tmp_path)["label"] == "a run"
    assert {path.name for path in (tmp_path / "data").iterdir()} == {"run.js", "route-0.js"}
    assert {path.name for path in tmp_path.iterdir()} == {"index.html", "data", "static", MARK}


def test_a_full_disk_leaves_the_earlier_report(tmp_path):
    page = write_pages(tmp_path, records(make_result("101")))
    earlier = page.read_bytes()
    with full_disk(1000), pytest.raises(OSError, match="File too large"):
        write_pages(tmp_path, records(make_result("101"), make_result("301")))
    assert page.read_bytes() == earlier
    assert {path.name for path in tmp_path.iterdir()} == {"index.html", "data", "static", MARK}
    assert {path.name for path in (tmp_path / "data").iterdir()} == {"run.js", "route-0.js"}


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "report").write_text("")
    with pytest.raises(UsageError, match=r"--out is .*which is a file"):
        check_folder(tmp_path / "report", source="--out")
    check_folder(tmp_path / "new", source="--out")


def test_the_motion_of_an_episode_is_there_to_the_centimetre():
    draws = np.random.default_rng(3)
    columns = {name: np.cumsum(draws.normal(0.0, 0.3, 101)) for name in ("x_m", "y_m", "yaw_rad", "speed_mps")}
    ego, told = motion_of(motion_text(make_result(trace=trace_of(101, steer=-0.25, **columns))))
    assert len(told) == 0
    assert np.abs(ego[:, 0] / 100.0 - columns["x_m"][::2]).max() <= 0.005
    assert np.abs(ego[:, 3] / 100.0 - columns["speed_mps"][::2]).max() <= 0.005
    assert set(ego[:, 5]) == {-250}
    turned = ego[:, 2] / 1000.0 - columns["yaw_rad"][::2]
    assert np.abs((turned + np.pi) % (2.0 * np.pi) - np.pi).max() <= 0.0006


def test_what_the_agent_was_told_is_there_where_a_failure_touched_it():
    rows = np.zeros((8, 6), np.float32)
    rows[:, 0], rows[:, 1], rows[:, 4], rows[:, 5] = range(8), 12.3, 7.0, (0, 1, 2, 2, 2, 2, 2, 2)
    touched = Reception(("front",), (), 8, (Touch("gps", 8, 0), Touch("front", 5, 3)))
    result = replace(make_result(), given=Given(rows), reception=touched)
    assert motion_of(motion_text(result))[1].tolist() == [[0, 123, 0, UNTOUCHED, 0], [4, 123, 0, UNTOUCHED, 2]]
    control = replace(result, reception=replace(touched, touched=(Touch("control", 8, 0),)))
    assert len(motion_of(motion_text(control))[1]) == 0


def test_an_episode_without_a_trace_is_listed_and_has_no_motion(tmp_path):
    found, _ = document(make_result("101"))
    write_pages(tmp_path, RunRecords.of(found, lambda key: None, default_registry(), label="x"))
    run = data_of(tmp_path)
    assert run["episodes"]["trace"] == [0]
    assert any("1 of 1 episodes are not in the store" in note for note in run["notes"])
    assert data_of(tmp_path, "route-0")["episodes"] == {"0": ["", ""]}


def test_two_routes_of_one_id_are_refused(tmp_path):
    with pytest.raises(UsageError, match=r"the run 'a run' holds two routes with the id '101' for \S+ under clean"):
        records(make_result("101"), make_result("102"), make_result("101"))


def test_two_files_with_one_id_are_refused_under_different_settings_too(tmp_path):
    first, second = resolve_routes("one-per-scenario")[:2]
    files = [str(tmp_path / name) for name in ("a.xml", "b.xml")]
    for file, route in zip(files, (first, second), strict=True):
        save_routes([replace(route, id="101")], Path(file))
    found = {"a": make_result("101"), "b": make_result("101", setting=SETTING)}
    settings = ("clean", SETTING)
    needed = [
        EpisodesNeeded("driver", *scope, (0,), (key,))
        for scope, key in zip(zip(files, settings, strict=True), "ab", strict=True)
    ]
    run = RunResult.of(RunOptions(simulator="embedded"), [*needed, Used(("a", "b"))], found.get, versions={})
    with pytest.raises(UsageError, match=r"the run 'a run' holds two routes with the id '101', so they cannot be told"):
        RunRecords.of(run_as_json(run), found.get, default_registry(), label="a run")


def test_a_route_is_driven_again_from_the_file_that_holds_it(tmp_path):
    routes = resolve_routes("one-per-scenario")[:2]
    files = [str(tmp_path / name) for name in ("a.xml", "b.xml")]
    for file, route in zip(files, routes, strict=True):
        save_routes([replace(route, id=f"mine {route.id}")], Path(file))
    found = {route.id: make_result(f"mine {route.id}") for route in routes}
    needed = [EpisodesNeeded("driver", file, "clean", (0,), (key,)) for file, key in zip(files, found, strict=True)]
    run = RunResult.of(RunOptions(simulator="embedded"), [*needed, Used(tuple(found))], found.get, versions={})
    write_pages(tmp_path / "out", RunRecords.of(run_as_json(run), found.get, default_registry(), label="a run"))
    data = data_of(tmp_path / "out")
    assert [route["file"] for route in data["routes"]] == files
    assert [row["label"] for row in data["rows"]] == ["clean on a.xml", "clean on b.xml"]


def test_a_route_that_was_changed_since_is_not_shown_as_what_was_driven(tmp_path):
    mine = tmp_path / "mine.xml"
    driven, other = (replace(route, id="mine") for route in resolve_routes("one-per-scenario")[:2])
    save_routes([driven], mine)
    found, find = document(make_result("mine"), spec=str(mine))
    found["fingerprint"] = {"agents": {}, "routes": {"mine": route_digest(resolve_routes(str(mine))[0])}}

    def shown():
        write_pages(tmp_path / "out", RunRecords.of(found, find, default_registry(), label="a run"))
        data = data_of(tmp_path / "out")
        return data["routes"][0]["town"], bool(data_of(tmp_path / "out", "route-0")["maps"]), data["notes"]

    assert shown() == (driven.town, True, [])
    save_routes([other], mine)
    told = "the roads of routes that are not as the run drove them are not shown: mine."
    assert shown() == ("", False, [told])


def test_an_episode_that_ended_before_its_first_tick_is_not_said_to_be_missing(tmp_path):
    found, find = document(replace(make_result("101", end=End.AGENT_CRASHED, trace=trace_of(0)), ticks=0))
    write_pages(tmp_path, RunRecords.of(found, find, default_registry(), label="x"))
    assert data_of(tmp_path)["notes"] == []


def test_the_road_of_a_route_that_is_not_there_any_more_is_missing_and_nothing_else(tmp_path):
    write_pages(tmp_path, records(make_result("no such route"), spec="gone.xml"))
    assert data_of(tmp_path, "route-0")["maps"] == {}
    write_pages(tmp_path, records(make_result("101")))
    road = data_of(tmp_path, "route-0")["maps"]["any"]
    assert road["ego"] == [489, 184]
    assert len(road["lanes"]) > 2


def test_rows_tell_what_was_not_driven(tmp_path):
    run, find = document(make_result("101"))
    run["summaries"][0]["episodes_needed"] = 2
    write_pages(tmp_path, RunRecords.of(run, find, default_registry(), label="x"))
    assert any("1 of 2 episodes not driven" in note for note in data_of(tmp_path)["notes"])


def test_every_kind_of_episode_can_be_shown(tmp_path):
    write_pages(tmp_path, records(FULL, crashed_simulation("101"), make_result("301", trace=trace_of(0))))
    columns = data_of(tmp_path)["episodes"]
    assert columns["ds"][1] is None
    assert columns["trace"] == [1, 1, 0]


def test_an_impact_is_told_in_the_unit_of_the_speeds_beside_it_and_names_the_vehicle(tmp_path):
    told = Infraction(InfractionKind.COLLISION_VEHICLE, 20, "hit emergency at 9.3 m/s")
    write_pages(tmp_path, records(make_result("101", infractions=[told])))
    assert "hit emergency vehicle at 33 km/h" in data_of(tmp_path)["episodes"]["words"]


def test_what_nobody_told_of_an_infraction_is_null(tmp_path):
    events = [Infraction(InfractionKind.RED_LIGHT, *told) for told in ((0, "", 1.5, 2.0), (0, ""), (20, ""))]
    write_pages(tmp_path, records(make_result("101", infractions=events)))
    (shown,) = data_of(tmp_path)["episodes"]["events"]
    assert [(second, x_cm, y_cm) for _, second, _, x_cm, y_cm in shown] == [
        (None, 150, 200),
        (None, None, None),
        (1.0, 0, 0),
    ]


def test_an_episode_knows_its_clean_twin_whatever_the_order(tmp_path):
    write_pages(tmp_path, evidence()[2])
    columns = data_of(tmp_path)["episodes"]
    words = columns["words"]
    for setting, route, twin in zip(columns["setting"], columns["route"], columns["twin"], strict=True):
        if words[setting] == SETTING:
            assert (words[columns["setting"][twin]], columns["route"][twin]) == ("clean", route)
        else:
            assert twin == -1


def test_the_groups_of_failures_are_those_of_the_episodes(tmp_path):
    hit = make_result("101", infractions=[InfractionKind.COLLISION_PEDESTRIAN], setting=SETTING)
    write_pages(tmp_path, records(hit, make_result("101"), spec="gone.xml"))
    run = data_of(tmp_path)
    (cluster,) = run["clusters"]
    assert cluster["sentence"] == "Hit a pedestrian while following the road"
    (number,) = cluster["episodes"]
    assert run["episodes"]["words"][run["episodes"]["setting"][number]] == SETTING


@pytest.mark.parametrize("agent_before", ["driver", "it had another name"])
def test_a_comparison_brings_the_episodes_that_flipped(tmp_path, agent_before):
    ids = [route.id for route in resolve_routes("one-per-scenario")]
    before = records(*(scored(name, 100.0, agent=agent_before) for name in ids))
    scores = [100.0 if n % 4 else 20.0 for n in range(len(ids))]
    after = records(*(scored(name, score) for name, score in zip(ids, scores, strict=True)))
    found = compare(
        snapshot_of(before.document, label="old"), snapshot_of(after.document, label="new"), Terms(rule="list")
    )
    write_pages(tmp_path, after, comparison=found, before=before)
    run = data_of(tmp_path)
    (cell,) = run["comparison"]["settings"]
    assert run["comparison"]["regressed"]
    mean, low, high = cell["dsChange"]
    assert mean == pytest.approx(-20.0, abs=0.1)
    assert low < mean < high
    assert (cell["agent"], cell["agentBefore"]) == ("driver", agent_before)
    assert len(cell["flips"]) == 11
    assert run["episodes"]["run"].count(1) == 11
    flipped = run["episodes"]["run"].index(1)
    assert run["episodes"]["ds"][flipped] == 100.0
