"""Blessed baselines: nothing is lost, and one route a line."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from snapshot_factory import PRINT, SIGNATURE, cell, route_score, snapshot, with_versions

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.baselines import Baseline, BlessedRoute, Blessing, merge, read_baseline
from pytest_drive_robust.regression.bless import bless
from pytest_drive_robust.regression.references import References
from pytest_drive_robust.regression.snapshot import RouteScore

places = st.tuples(
    st.sampled_from(["embedded", "fake"]),
    st.sampled_from(["clean", "200 ms latency"]),
    st.text("0123456789-x", min_size=1, max_size=4),
)
fingerprints = st.builds(lambda number: with_versions(numpy=f"{number}.0"), st.integers(1, 3))
blessings = st.builds(
    Blessing,
    date=st.sampled_from(["2026-11-20", "2026-11-21"]),
    reason=st.text(min_size=1, max_size=8),
    by=st.sampled_from(["", "kim"]),
    run=st.just("before"),
    commit=st.just(""),
    fingerprint=fingerprints,
)


@st.composite
def baselines(draw: st.DrawFn) -> Baseline:
    known = draw(st.dictionaries(st.sampled_from(["2026-11-20", "2026-11-21", "2026-11-22"]), blessings, min_size=1))
    score = st.builds(
        RouteScore,
        route_id=st.just(""),
        fingerprint=st.just(PRINT),
        scenario=st.just("Kind"),
        ds=st.integers(0, 100000).map(lambda number: number / 1000.0),
        sr=st.sampled_from([0.0, 0.5, 1.0]),
        seeds=st.just((0, 1)),
        worst_seed=st.just(1),
        outcome=st.text(max_size=5),
        digest=st.sampled_from(["", "d0", "d1"]),
    )
    drawn = draw(st.dictionaries(places, st.tuples(st.sampled_from(sorted(known)), score), max_size=8))
    routes = {
        place: BlessedRoute(name, replace(score, route_id=place[2], fingerprint=known[name].fingerprint))
        for place, (name, score) in drawn.items()
    }
    return Baseline("driver", known, routes)


def scores(baseline: Baseline) -> dict[object, object]:
    """What must not be lost: each score with the whole of its blessing, whatever that is called."""
    return {place: (route.score, baseline.blessings[route.blessing]) for place, route in baseline.routes.items()}


@settings(max_examples=50)
@given(baselines(), baselines())
def test_a_blessing_replaces_what_it_drove_and_loses_nothing_else(old: Baseline, new: Baseline) -> None:
    assert scores(merge(old, new)) == {**scores(old), **scores(new)}


@settings(max_examples=50)
@given(baselines(), baselines(), baselines())
def test_many_blessings_lose_nothing(first: Baseline, second: Baseline, third: Baseline) -> None:
    merged = merge(merge(first, second), third)
    assert scores(merged) == {**scores(first), **scores(second), **scores(third)}
    assert set(merged.blessings) == {route.blessing for route in merged.routes.values()}


@given(baselines())
def test_blessing_the_same_again_changes_nothing(baseline: Baseline) -> None:
    once = merge(Baseline("driver"), baseline)
    assert merge(once, baseline).to_text() == once.to_text()


def test_the_file_reads_back_to_the_last_digit(tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("baselines") / "driver.json"

    @given(baselines())
    def check(baseline: Baseline) -> None:
        path.write_text(baseline.to_text(), encoding="utf-8")
        assert read_baseline(path) == baseline
        shuffled = replace(baseline, routes=dict(reversed(baseline.routes.items())))
        assert shuffled.to_text() == baseline.to_text()

    check()


def test_one_route_is_one_line_and_ids_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    run = snapshot(cell({"10": 100.0, "9": 36.123456, "x-2": 1.0}))
    (blessed,) = bless(run, tmp_path, SIGNATURE, environ={})
    lines = blessed.path.read_text().splitlines()
    routes = [line.strip() for line in lines if '"ds"' in line]
    assert [line.split(":")[0] for line in routes] == ['"9"', '"10"', '"x-2"']
    assert '"ds": 36.123456,' in routes[0], "rounded it would differ from the run that it is"
    assert json.loads(blessed.path.read_text())["agent"] == "driver"
    assert sum("first baseline" in line for line in lines) == 1
    before = blessed.path.read_text()
    bless(snapshot(cell({"9": 40.0})), tmp_path, SIGNATURE, environ={})
    changed = set(before.splitlines()) ^ set(blessed.path.read_text().splitlines())
    assert len(changed) == 2, "the diff is the line of the route that changed"


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": 2}', '{"schema": 1, "agent": "a", "blessings": 1}'])
def test_a_damaged_file_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "driver.json"
    path.write_text(text)
    with pytest.raises(UsageError, match=r"driver\.json"):
        read_baseline(path)


@pytest.mark.parametrize(
    ("was", "now", "told"),
    [
        ('"ds": 50.0', '"ds": "50"', '.1.ds must be number, not "50"'),
        ('"ds": 50.0', '"ds": null', ".1.ds must be number, not null"),
        ('"ds": 50.0', '"ds": NaN', "NaN is not a number in JSON"),
        ('"ds": 50.0', '"ds": 500.0', ".1.ds must be smaller than or equal to 100, not 500.0"),
        ('"sr": 0.0', '"sr": -1.0', ".1.sr must be bigger than or equal to 0, not -1.0"),
        ('"worst_seed": 0', '"worst_seed": "0"', '.1.worst_seed must be integer, not "0"'),
        ('"outcome": "stuck"', '"outcome": 7', ".1.outcome must be string, not 7"),
        ('"numpy": "2.0"', '"numpy": 2.0', ".fingerprint.versions.numpy must be string, not 2.0"),
        ('"blessing": "', '"blessing": "x', "route '1' names the blessing 'x2026-11-21-1', which is not there"),
        ('"agent": "driver"', '"agent": ["driver"]', 'agent must be string, not ["driver"]'),
    ],
)
def test_a_score_that_was_edited_into_none_is_refused(tmp_path: Path, was: str, now: str, told: str) -> None:
    (blessed,) = bless(snapshot(cell([50.0])), tmp_path, SIGNATURE, environ={})
    text = blessed.path.read_text()
    assert text.count(was) == 1
    blessed.path.write_text(text.replace(was, now))
    with pytest.raises(UsageError, match=rf"driver\.json' is not (a baseline|valid JSON): .*{re.escape(told)}\.$"):
        read_baseline(blessed.path)


def test_a_route_that_a_merge_left_twice_is_refused(tmp_path: Path) -> None:
    (blessed,) = bless(snapshot(cell([90.0])), tmp_path, SIGNATURE, environ={})
    (line,) = [line for line in blessed.path.read_text().splitlines() if '"ds": 90.0' in line]
    both = f"{line},\n{line.replace('90.0', '40.0')}"
    blessed.path.write_text(blessed.path.read_text().replace(line, both))
    with pytest.raises(UsageError, match=r"driver\.json' is not valid JSON: '1' stands there twice"):
        read_baseline(blessed.path)


def test_a_copy_beside_a_baseline_is_refused(tmp_path: Path) -> None:
    bless(snapshot(cell([90.0])), tmp_path, SIGNATURE, environ={})
    copy = tmp_path / "driver_old.json"
    copy.write_text((tmp_path / "driver.json").read_text().replace('"ds": 90.0', '"ds": 40.0'))
    for reference in ("baseline", "baseline:driver", "auto"):
        with pytest.raises(UsageError, match="more than one file of the agent 'driver'"):
            References(tmp_path, tmp_path).load(reference)
    copy.rename(tmp_path / "driver_old.json.bak")
    assert References(tmp_path, tmp_path).load("baseline").cells["driver", "clean"].routes["1"].ds == 90.0


def test_baselines_of_two_agents_do_not_merge() -> None:
    with pytest.raises(UsageError, match="of agent 'a', expected 'b'"):
        merge(Baseline("a"), Baseline("b"))


def test_routes_whose_numbers_are_equal_have_an_order() -> None:
    score = route_score("1", 0.0)
    blessing = Blessing("2026-11-20", reason="first", by="", run="before", commit="", fingerprint=PRINT)
    names = ("10", "00", "9", "0")
    routes = {("embedded", "clean", name): BlessedRoute("2026-11-20", replace(score, route_id=name)) for name in names}
    baseline = Baseline("driver", {blessing.date: blessing}, routes)
    turned = replace(baseline, routes=dict(reversed(routes.items())))
    assert turned.to_text() == baseline.to_text()
    assert list(json.loads(baseline.to_text())["scores"]["embedded"]["clean"]) == ["0", "00", "9", "10"]


def test_a_baseline_that_is_nested_so_deeply_that_it_can_just_be_read_is_refused_in_a_sentence(tmp_path: Path) -> None:
    for depth in range(1, sys.getrecursionlimit()):
        nested = "[" * depth + "]" * depth
        (tmp_path / "a.json").write_text(f'{{"schema": 1, "agent": {nested}, "blessings": {{}}, "scores": {{}}}}')
        with pytest.raises(UsageError, match=r"is not a baseline: .* not |it is nested too deeply"):
            read_baseline(tmp_path / "a.json")
