from __future__ import annotations

import re
from dataclasses import replace

import pytest
from result_factory import crashed_simulation, make_result, scored

from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.report.github import step_summary
from pytest_drive_robust.report.json_file import run_as_json
from pytest_drive_robust.report.page import Page
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.report.terminal import run_summary
from pytest_drive_robust.store.events import EpisodesNeeded, Judged, Spared, Used


def run_of(*groups, judged=()):
    """A run in which each group is (setting, results); clean groups are the twins of the others."""
    needed, found, clean = [], {}, ()
    for setting, results in groups:
        keys = tuple(f"{setting} {result.episode.route_id}" for result in results)
        found.update(zip(keys, results, strict=True))
        needed.append(EpisodesNeeded("driver", "dev10", setting, (0,), keys, clean if setting != "clean" else ()))
        clean = keys if setting == "clean" else clean
    return RunResult.of(RunOptions(), [*needed, *judged, Used(tuple(found))], found.get, versions={})


def verdict(setting, word):
    return Judged("test_x.py::t", "...", "driver", "dev10", (0,), "RD", setting, "<=", 0.3, word)


def test_rows_have_numbers_and_the_worst_verdict():
    run = run_of(
        ("clean", [scored("1", 100.0), scored("2", 50.0)]),
        ("200 ms latency", [scored("1", 50.0, setting="200 ms latency"), scored("2", 25.0, setting="200 ms latency")]),
        judged=[verdict("200 ms latency", "pass"), verdict("200 ms latency", "fail")],
    )
    lines = run_summary(run, colour=False).splitlines()
    assert lines[1].split() == ["driver", "clean", "75.00", "0.50", "-", "100.00", "100.00", "2", "-"]
    assert lines[2].split() == [
        "driver",
        "200",
        "ms",
        "latency",
        "37.50",
        "0.00",
        "0.50",
        "100.00",
        "100.00",
        "2",
        "fail",
    ]


def test_a_long_agent_and_a_long_setting_stay_within_a_hundred_columns():
    setting = "occlusion 0.5 and 3.0 s burst frame drop and 200 ms latency (mode=hold) and GPS noise 15 m"
    results = [make_result(str(number), setting=setting) for number in range(24)]
    run = run_of((setting, results), judged=[verdict(setting, "error")])
    lines = run_summary(run, colour=False).splitlines()
    assert max(map(len, lines)) <= 100
    assert "error" in lines[1]
    width = lines[0].index("DS") - 8
    assert setting.replace(" ", "") in "".join("".join(line[8 : 4 + width].split()) for line in lines[1:4])


@pytest.mark.parametrize("width", [80, 100, 200])
def test_intervals_go_below_their_numbers_where_a_terminal_is_narrow(width):
    clean = {f"clean {number}": scored(str(number), 100.0) for number in range(9)}
    late = {f"late {number}": scored(str(number), 50.0, setting="200 ms latency") for number in range(9)}
    events = [
        EpisodesNeeded("driver", "dev10", "200 ms latency", (0,), tuple(late), tuple(clean)),
        Used(tuple(late)[:6]),
        Used(tuple(clean)[:6]),
        Spared(tuple(late)[6:]),
        Spared(tuple(clean)[6:]),
        verdict("200 ms latency", "pass"),
    ]
    run = RunResult.of(RunOptions(), events, {**clean, **late}.get, versions={})
    for colour in (False, True):
        lines = re.sub(r"\x1b\[[\d;]*m", "", run_summary(run, colour=colour, width=width)).splitlines()
        assert max(map(len, lines)) <= min(width, 100)
        row = next(line for line in lines if "50.00" in line)
        assert ("50.00 (" in row) == (width >= 100)


@pytest.mark.parametrize("colour", [False, True])
def test_columns_stand_closer_before_a_row_breaks_on_eighty_columns(colour):
    page = Page(colour=colour, width=80)
    numbers = ("86.82 (36 to 100)", "0.83", "0.73 (-0.79 to 0.92)", "40.42", "44/220")
    rows = [("classical", "occlusion 0.8 and 200 ms latency", *numbers, "inconclusive")]
    page.table(("DS", "SR", "RD", "comfort", "routes"), rows, setting_width=40)
    lines = re.sub(r"\x1b\[[\d;]*m", "", page.text).splitlines()
    assert max(map(len, lines)) <= 80
    row = next(line for line in lines if "86.82" in line)
    assert row.split() == ["classical", "occlusion", "86.82", "0.83", "0.73", "40.42", "44/220", "inconclusive"]


def measured(metric: str, value: float | None) -> Judged:
    return Judged("t", "...", "driver", "dev10", (0,), metric, "clean", "<=", 9.0, "pass", value)


def test_a_metric_that_a_requirement_names_has_a_column():
    results = [scored("1", 100.0)]
    run = run_of(("clean", results), ("fog", results), judged=[measured("hardest_braking", 4.256)])
    head, clean, fog = run_summary(run, colour=False).splitlines()
    assert head.split() == ["agent", "setting", "DS", "SR", "RD", "hardest_braking", "routes", "verdict"]
    assert clean.split() == ["driver", "clean", "100.00", "1.00", "-", "4.26", "1", "pass"]
    assert fog.split()[-3:] == ["-", "1", "-"]


def test_as_many_metrics_have_columns_as_fit():
    names = [f"a_metric_as_long_{number}" for number in range(3)]
    run = run_of(("clean", [scored("1", 100.0)]), judged=[measured(name, None) for name in (*names, "comfort")])
    head, *lines = run_summary(run, colour=False).splitlines()
    assert "comfort" in head
    assert "efficiency" not in head
    assert [name in head for name in names] == [True, True, False]
    assert max(map(len, (head, *lines))) <= 100
    assert "no column is left for a_metric_as_long_2: --drive-json FILE has the values" in lines


def test_names_are_folded_and_numbers_are_never_cut():
    results = [scored(str(number), 100.0) for number in range(9)]
    settings = ("200 ms latency", "1 s burst frame drop")
    names = ("mypackage.drivers:TransfuserV1", "mypackage.drivers:TransfuserV2")
    rows = tuple(
        replace(
            run_of((setting, results)).rows[0],
            agent=name,
            results=tuple(replace(result, privileged=name == names[0]) for result in results),
            ds_interval=(24.0, 78.0),
            rd=0.31,
            rd_interval=(0.12, 0.71),
            judged={"efficiency": 99.0, "comfort": 58.97, "time_to_collision": 1.25},
            verdict="inconclusive",
        )
        for name in names
        for setting in settings
    )
    run = replace(run_of((settings[0], results)), rows=rows)
    for colour in (False, True):
        text = re.sub(r"\x1b\[[\d;]*m", "", run_summary(run, colour=colour))
        lines = text.splitlines()
        table = lines[: next(number for number, line in enumerate(lines) if line.startswith("* priv"))]
        width = next(line.index("setting") for line in table if "setting" in line)
        told = "".join(line[:width].strip(" ─") for line in table)
        assert told.startswith(f"agent{names[0]}*{names[0]}*{names[1]}")
        for word in ("(24 to 78)", "(0.12 to 0.71)", "100.00", "1.25", "inconclusive", "9"):
            assert sum(line.count(f"{word} ") + line.endswith(word) for line in table) >= 4, (word, text)
        assert "latency" in text
        assert "drop" in text


def test_a_message_is_printed_as_it_is():
    broken = [make_result("1", end=End.AGENT_CRASHED, end_detail="ValueError: map.py:100: off the map, a:b:c")]
    assert "map.py:100: off the map, a:b:c" in run_summary(run_of(("clean", broken)), colour=False)


def test_agent_errors_are_listed_once_per_reason():
    broken = [make_result(str(number), end=End.AGENT_CRASHED, end_detail="ValueError: no") for number in range(5)]
    text = run_summary(run_of(("clean", broken)), colour=False)
    assert "5 x agent error: ValueError: no (first driver on 0 under clean, seed 0)" in text.replace("\n", " ")
    command = "drive-robust replay 0 --agent driver --setting clean --seed 0"
    assert f"  replay (it ended after {broken[0].ticks} ticks):  {command}" in text.splitlines()
    evaluated = replace(run_of(("clean", broken)), options=RunOptions(simulator="bench2drive"))
    text = run_summary(evaluated, colour=False)
    assert "5 x agent error: ValueError: no" in text
    assert "drive-robust replay" not in text


def test_episodes_of_machines_that_compute_differently_are_not_mixed_unsaid():
    def driven_on(route, machine):
        return make_result(route, versions={"embedded": "1", "machine numpy": machine, "machine torch": "same"})

    alike = run_of(("clean", [driven_on("1", "aa"), driven_on("2", "aa"), make_result("3")]))
    assert "machines" not in run_summary(alike, colour=False)
    mixed = run_of(("clean", [driven_on("1", "aa"), driven_on("2", "bb"), driven_on("3", "aa")]))
    told = "driven on machines whose numpy gives different bits (2 on aa, 1 on bb)"
    assert told in run_summary(mixed, colour=False).replace("\n", " ")
    assert any(told in note for note in run_as_json(mixed)["notes"])
    assert "torch gives" not in run_summary(mixed, colour=False)
    anywhere = run_of(("clean", [make_result("1"), driven_on("2", "aa")]))
    assert "machines" not in run_summary(anywhere, colour=False)


@pytest.mark.parametrize(
    ("metric", "comparison", "word", "told"),
    [
        ("RD", ">=", "pass", "lets the worse of two agents pass, because less RD is better. Did you mean '<='?"),
        ("DS", "<=", "pass", "lets the worse of two agents pass, because more DS is better. Did you mean '>='?"),
        ("RD", ">=", "fail", None),
        ("RD", "<=", "pass", None),
        ("efficiency", "<=", "pass", None),
    ],
)
def test_a_requirement_that_a_worse_agent_passes_is_told_of_where_it_was_passed(metric, comparison, word, told):
    stated = replace(verdict("clean", word), requirement="STATED", metric=metric, comparison=comparison)
    run = run_of(("clean", [scored("1", 100.0)]), judged=[stated, replace(stated, agent="other")])
    text = " ".join(run_summary(run, colour=False).split())
    assert text.count("warning: STATED") == (told is not None)
    assert told is None or f"warning: STATED {told}" in text
    assert run_as_json(run)["notes"] == ([] if told is None else [f"warning: STATED {told}"])


@pytest.mark.parametrize(
    ("metric", "limit", "told"), [("DS", 0.6, True), ("DS", 1.0, False), ("DS", 0.0, False), ("SR", 0.6, False)]
)
def test_a_driving_score_that_was_asked_for_as_a_share_is_told_of(metric, limit, told):
    stated = replace(verdict("clean", "pass"), requirement="STATED", metric=metric, comparison=">=", limit=limit)
    text = " ".join(run_summary(run_of(("clean", [scored("1", 2.0)]), judged=[stated]), colour=False).split())
    assert ("warning: STATED is hardly a limit, because DS is 0 to 100. Did you mean 60?" in text) is told


def test_of_many_requirements_that_hardly_ask_for_anything_ten_are_named():
    stated = replace(verdict("clean", "pass"), metric="DS", comparison=">=", limit=0.6)
    judged = [replace(stated, requirement=f"STATED-{number}-") for number in range(12)]
    text = " ".join(run_summary(run_of(("clean", [scored("1", 2.0)]), judged=judged), colour=False).split())
    assert "STATED-9-" in text
    assert "STATED-10-" not in text
    assert "warning: and 2 more requirements like these" in text


def test_a_simulation_error_has_no_numbers():
    run = run_of(("clean", [crashed_simulation("1")]), judged=[verdict("clean", "error")])
    text = run_summary(run, colour=False)
    assert text.splitlines()[1].split() == ["driver", "clean", "-", "-", "-", "-", "-", "1", "error"]
    assert "1 x simulation error, never scored: the server went away" in text
    (row,) = run_as_json(run)["summaries"]
    assert row["summary"] is None
    assert row["problem"]


def test_early_stops_are_mentioned():
    stuck = [make_result("1", end=End.STUCK, completion_pct=10.0), make_result("2")]
    assert "1 of 2 episodes were stopped early" in run_summary(run_of(("clean", stuck)), colour=False)


def test_an_interrupted_setting_says_how_much_is_there():
    needed = EpisodesNeeded("driver", "dev10", "clean", (0,), ("a", "b"), ())
    run = RunResult.of(RunOptions(), [needed, Used(("a",))], {"a": make_result("1")}.get, versions={})
    text = run_summary(run, colour=False)
    assert "1 of 2" in text.splitlines()[1]
    assert "the run ended before the others were driven, or a verdict was an error" in text


def test_a_row_has_the_verdicts_of_all_names_of_its_routes():
    found = {"a": make_result("101"), "b": make_result("102")}
    needed = [EpisodesNeeded("driver", spec, "clean", (0,), ("a", "b"), ()) for spec in ("mine.xml", "./mine.xml")]
    judged = [replace(verdict("clean", "pass"), metric="DS", value=100.0, routes_spec="mine.xml")]
    judged += [replace(verdict("clean", "fail"), metric="comfort", value=12.5, routes_spec="./mine.xml")]
    run = RunResult.of(RunOptions(), [*needed, *judged, Used(("a", "b"))], found.get, versions={})
    (row,) = run.rows
    assert row.verdict == "fail"
    assert row.judged == {"DS": 100.0, "comfort": 12.5}


def test_rows_on_other_routes_or_seeds_say_so():
    found = {name: make_result(name) for name in "abc"}
    needed = [
        EpisodesNeeded("driver", "101", "clean", (0,), ("a",), ()),
        EpisodesNeeded("driver", "101", "clean", (0, 1), ("a", "c"), ()),
        EpisodesNeeded("driver", "mine/night.xml", "clean", (0,), ("b",), ()),
    ]
    run = RunResult.of(RunOptions(), [*needed, Used(tuple(found))], found.get, versions={})
    names = ["clean on 101, seed 0", "clean on 101, seeds 0, 1", "clean on night.xml, seed 0"]
    lines = run_summary(run, colour=False).splitlines()
    assert [re.split(r" {2,}", line)[1] for line in lines[1:4]] == names
    markdown = step_summary(run)
    assert all(f"| {name} |" in markdown for name in names)


def test_a_run_that_asked_for_nothing_has_no_table():
    assert run_summary(run_of(), colour=False) == ""


def test_rows_of_early_verdicts_are_not_compared_by_score():
    clean = {f"clean {number}": scored(str(number), 100.0) for number in range(9)}
    late = {f"late {number}": scored(str(number), 50.0, setting="late") for number in range(9)}
    needed = [
        EpisodesNeeded("driver", "dev10", "clean", (0,), tuple(clean), ()),
        EpisodesNeeded("driver", "dev10", "late", (0,), tuple(late), tuple(clean)),
    ]
    used = [Used(tuple(clean)[:6]), Used(tuple(late)[:4])]
    events = [*needed, *used, Spared(tuple(clean)[6:]), Spared(tuple(late)[4:]), verdict("late", "pass")]
    run = RunResult.of(RunOptions(), events, {**clean, **late}.get, versions={})
    head, first, second, *notes = run_summary(run, colour=False).splitlines()
    assert head.split() == ["agent", "setting", "DS", "SR", "RD", "routes", "verdict"]
    assert re.fullmatch(r"driver +clean +100\.00 \(\d+ to 100\) +1\.00 +- +6/9 +-", first)
    assert re.fullmatch(r"driver +late +50\.00 \(\d+ to \d+\) +0\.00 +0\.50 \(< -1 to \S+\) +4/9 +pass", second)
    assert "Between rows compare RD" in " ".join(notes)
    clean_row, late_row = run_as_json(run)["summaries"]
    assert (clean_row["routes"], clean_row["routes_planned"], clean_row["rd_interval"]) == (6, 9, None)
    assert late_row["ds_interval"][0] < 50.0 < late_row["ds_interval"][1]
    assert late_row["rd_interval"][0] < 0.5 < late_row["rd_interval"][1]
    whole = [*needed, Used((*clean, *late)), verdict("late", "pass")]
    text = run_summary(RunResult.of(RunOptions(), whole, {**clean, **late}.get, versions={}), colour=False)
    assert "efficiency" in text
    assert "Between rows" not in text


def test_an_rd_that_one_route_leaves_open_has_no_digits():
    clean = {f"clean {number}": scored(str(number), 100.0) for number in range(9)}
    late = {f"late {number}": scored(str(number), 50.0, setting="late") for number in range(9)}
    needed = [
        EpisodesNeeded("driver", "dev10", "clean", (0,), tuple(clean), ()),
        EpisodesNeeded("driver", "dev10", "late", (0,), tuple(late), tuple(clean)),
    ]
    spared = [Used(("clean 0", "late 0")), Spared(tuple(clean)[1:]), Spared(tuple(late)[1:])]
    run = RunResult.of(RunOptions(), [*needed, *spared], {**clean, **late}.get, versions={})
    assert "0.50 (< -1 to " in run_summary(run, colour=False)


def test_a_clean_score_below_the_floor_has_no_degradation_to_show():
    run = run_of(
        ("clean", [scored("1", 0.001), scored("2", 20.0)]),
        ("200 ms latency", [scored(route, 100.0, setting="200 ms latency") for route in ("1", "2")]),
    )
    assert [row.rd for row in run.rows] == [None, None]
    assert [row["rd"] for row in run_as_json(run)["summaries"]] == [None, None]
