"""`benchmarks/paper.py`: reports of agents, settings, routes and seeds are put together, and nothing is mixed."""

from __future__ import annotations

import itertools
import json
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from _paper import estimates, joining, results, table_page
from _paper.published import CLEAN, FAMILIES
from _paper.readings import DRIVEN, NO_LATENCY, READINGS, Drives, called_in
from hypothesis import given
from hypothesis import strategies as st
from made_up_drives import ALIKE, CLEAN_DS, as_published, report, saved

from pytest_drive_robust.errors import ComparisonError, UsageError

WARM = called_in("released", NO_LATENCY)


def test_agents_on_other_routes_are_not_compared(tmp_path: Path) -> None:
    files = saved(tmp_path, report("tcp", ALIKE), report("vad", ALIKE, routes=7))
    said = "vad was driven with seed 0 on 7 routes, tcp with seed 0 on 8; different: 801"
    with pytest.raises(ComparisonError, match=said):
        joining.read(files)


def test_a_new_report_replaces_its_agent_only(tmp_path: Path) -> None:
    old, vad, new = report("tcp", ALIKE), report("vad", ALIKE), as_published("tcp")
    found = joining.read(saved(tmp_path, old, vad, new))
    assert found.agents["tcp"] == joining.read(saved(tmp_path, new)).agents["tcp"]
    assert found.agents["vad"] == joining.read(saved(tmp_path, vad)).agents["vad"]


def test_other_weights_replace_their_agent_on_all_routes_at_once(tmp_path: Path) -> None:
    newer = report("tcp", {"clean": 0.9, "occlusion 0.5": 0.5}, routes=8)
    newer["fingerprint"]["agents"]["tcp"]["weights"] = "tcp@9.9:00000000"
    files = saved(tmp_path, report("tcp", ALIKE), report("vad", ALIKE), newer)
    old, tcp = tmp_path / "results.json", files[2]
    old.write_text(results.text_of(joining.read(files[:2])))
    with pytest.raises(ComparisonError, match="of another clean run"):
        joining.read([old, tcp])
    found = joining.read([old, tcp], replaced=["tcp"])
    assert found.agents["tcp"] == joining.read([tcp]).agents["tcp"]
    assert found.agents["vad"] == joining.read(files[1:2]).agents["vad"]


def test_a_file_that_is_replaced_whole_leaves_neither_its_routes_nor_its_world(tmp_path: Path) -> None:
    files = saved(tmp_path, report("tcp", ALIKE), report("tcp", ALIKE, routes=4))
    alone = joining.read(files[1:])
    assert joining.read(files, replaced=["tcp"]) == joining.read(files, replaced=["tcp"], only=["tcp"]) == alone
    newer = report("tcp", ALIKE, routes=4)
    newer["versions"]["simulator"] = "made-up 2"
    files[1].write_text(json.dumps(newer), encoding="utf-8")
    assert joining.read(files, replaced=["tcp"]).world == {"simulator": "made-up 2"}


@pytest.mark.parametrize(
    ("replaced", "said"),
    [
        (["uniad"], r"uniad to be replaced: .*0\.json, the first file, holds tcp\."),
        (["tcp"], "tcp to be replaced: no file after the first holds it. Give its reports"),
    ],
)
def test_an_agent_is_replaced_by_something(tmp_path: Path, replaced: list[str], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        joining.read(saved(tmp_path, report("tcp", ALIKE), report("vad", ALIKE)), replaced)


def test_agents_that_hold_more_routes_than_others_are_read_alone(tmp_path: Path) -> None:
    tcp, vad, fewer = saved(tmp_path, report("tcp", ALIKE), report("vad", ALIKE), report("vad", ALIKE, routes=7))
    both = tmp_path / "results.json"
    both.write_text(results.text_of(joining.read([tcp, vad])))
    assert joining.read([both], only=["tcp"]) == joining.read([tcp])
    with pytest.raises(UsageError, match=r"only tcp are wanted: .*2\.json holds vad\."):
        joining.read([both, fewer], only=["tcp"])


def test_an_agent_can_be_driven_setting_by_setting(tmp_path: Path) -> None:
    whole = as_published("uniad")
    parts = [
        {**whole, "episodes": [one for one in whole["episodes"] if one["setting"] in (CLEAN, WARM, setting)]}
        for setting in DRIVEN
    ]
    assert joining.read(saved(tmp_path, *parts[::-1])) == joining.read(saved(tmp_path, whole))


def test_latency_of_the_released_reading_needs_its_own_clean_drive_only(tmp_path: Path) -> None:
    whole = as_published("vad")
    latency = [WARM, *(called_in("released", row) for row in FAMILIES["latency"])]
    alone = {**whole, "episodes": [one for one in whole["episodes"] if one["setting"] in latency]}
    rest = {**whole, "episodes": [one for one in whole["episodes"] if one["setting"] not in latency]}
    found = joining.read(saved(tmp_path, alone))
    assert estimates.degradation(Drives(found, "released"), "vad", FAMILIES["latency"]) is not None
    assert estimates.driving_score(Drives(found, "released"), "vad", (CLEAN,)) is None
    assert "| `released`, latency | 3 of 12 |" in table_page.table_text(found)
    assert joining.read(saved(tmp_path, alone, rest)) == joining.read(saved(tmp_path, whole))


def test_a_setting_keeps_its_own_clean_run(tmp_path: Path) -> None:
    other = report("tcp", {"clean": 0.9, "occlusion 0.5": 0.5})
    with pytest.raises(ComparisonError, match=r"1\.json: tcp lacks 1 s burst frame drop, .* of another clean run"):
        joining.read(saved(tmp_path, report("tcp", ALIKE), other))
    newer = report("tcp", {"clean": 1.0, "occlusion 0.5": 0.5})
    newer["versions"]["lockstep"] = "8"
    with pytest.raises(ComparisonError, match="of another clean run"):
        joining.read(saved(tmp_path, report("tcp", ALIKE), newer))


def with_seed(document: dict[str, Any], seed: int) -> dict[str, Any]:
    return {**document, "settings": {**document["settings"], "seeds": [seed]}}


def test_seeds_are_averaged_route_by_route(tmp_path: Path) -> None:
    other = {**ALIKE, "occlusion 0.5": 0.5}
    parts = [with_seed(report("tcp", other), 1), report("tcp", ALIKE)]
    found = joining.read(saved(tmp_path, *parts))
    assert found.seeds == (0, 1)
    (alone,) = (joining.read(saved(tmp_path, report("tcp", ALIKE))).agents["tcp"].settings["occlusion 0.5"],)
    both = found.agents["tcp"].settings["occlusion 0.5"]
    assert both.driving_score == pytest.approx([0.75 * score for score in alone.driving_score])
    assert estimates.degradation(Drives(found, READINGS[0]), "tcp", ("occlusion 0.5",)).value == pytest.approx(0.25)
    assert f"{len(CLEAN_DS)} routes, seeds 0 and 1, simulator" in table_page.table_text(found)
    assert "its figures are the means over the seeds" in table_page.table_text(found)
    assert "over the seeds" not in table_page.table_text(joining.read(saved(tmp_path, parts[1])))
    assert results.results_of(json.loads(results.text_of(found))) == found


def test_efficiency_is_compared_with_that_of_the_same_route_and_seed(tmp_path: Path) -> None:
    parts = [with_seed(report("tcp", ALIKE), seed) for seed in (0, 1)]
    for seed, part in enumerate(parts):
        for episode in part["episodes"]:
            if episode["route_id"] == "101":  # clean has no data with seed 0, the row none with seed 1
                alone = seed == (episode["setting"] == CLEAN)
                episode["speed_ratios_pct"] = [20.0 if episode["setting"] == CLEAN else 180.0] if alone else []
    pair = estimates.efficiency_means(
        Drives(joining.read(saved(tmp_path, *parts)), READINGS[0]), "tcp", "occlusion 0.5"
    )
    assert pair is not None
    assert [side[0] for side in pair] == pytest.approx([100.0, 100.0])


def test_a_report_of_one_seed_is_put_over_results_of_several(tmp_path: Path) -> None:
    both = joining.read(saved(tmp_path, report("tcp", ALIKE), with_seed(report("tcp", ALIKE), 1)))
    (tmp_path / "results.json").write_text(results.text_of(both), encoding="utf-8")
    (later,) = saved(tmp_path, with_seed(report("tcp", {**ALIKE, "occlusion 0.5": 0.5}), 1))
    found = joining.read([tmp_path / "results.json", later])
    assert found.seeds == (0, 1)
    assert estimates.degradation(Drives(found, READINGS[0]), "tcp", ("occlusion 0.5",)).value == pytest.approx(0.25)
    assert joining.read([tmp_path / "results.json"]) == both


def test_every_seed_holds_the_same_drives(tmp_path: Path) -> None:
    lacking = {setting: share for setting, share in ALIKE.items() if setting != "occlusion 0.8"}
    with pytest.raises(
        ComparisonError, match=r"tcp under occlusion 0\.8 was driven in one of these only: seed 0, seed 1"
    ):
        joining.read(saved(tmp_path, report("tcp", ALIKE), with_seed(report("tcp", lacking), 1)))
    with pytest.raises(ComparisonError, match="tcp under clean, 1 s burst frame drop"):
        joining.read(saved(tmp_path, report("tcp", ALIKE), with_seed(report("vad", ALIKE), 1)))
    heavier = with_seed(report("tcp", ALIKE), 1)
    for made_of in heavier["fingerprint"]["agents"].values():
        made_of["weights"] = "cc"
    with pytest.raises(
        ComparisonError, match="with other weights, options, versions or --drive-stuck-stop in these: seed 0, seed 1"
    ):
        joining.read(saved(tmp_path, report("tcp", ALIKE), heavier))
    with pytest.raises(ComparisonError, match="tcp was driven with seed 1 on 7 routes, tcp with seed 0 on 8"):
        joining.read(saved(tmp_path, report("tcp", ALIKE), with_seed(report("tcp", ALIKE, routes=7), 1)))


def of_routes(document: dict[str, Any], routes: Iterable[int], comfort: float) -> dict[str, Any]:
    """The part of a report that is about some of its routes, by place."""
    kept = [str(100 * place + 101) for place in routes]
    part = json.loads(json.dumps(document))
    part["episodes"] = [episode for episode in part["episodes"] if episode["route_id"] in kept]
    part["fingerprint"]["routes"] = {route: part["fingerprint"]["routes"][route] for route in kept}
    for row in part["summaries"]:
        row["summary"] = {"episodes": len(kept), "comfort": comfort}
    return part


def test_routes_can_be_driven_in_parts(tmp_path: Path) -> None:
    whole, vad = as_published("tcp"), report("vad", ALIKE)
    first, second = of_routes(whole, range(2, 8), 20.0), of_routes(whole, range(2), 60.0)
    found = joining.read(saved(tmp_path, vad, first, second))
    expected = joining.read(saved(tmp_path, vad, whole))
    assert list(found.routes.items()) == list(expected.routes.items())
    for setting, scores in expected.agents["tcp"].settings.items():
        ours = found.agents["tcp"].settings[setting]
        assert ours.driving_score == scores.driving_score
        assert ours.success == scores.success
        assert ours.efficiency == scores.efficiency
        assert ours.comfort == pytest.approx((6 * 20.0 + 2 * 60.0) / 8)
    assert joining.read(saved(tmp_path, second, vad, first)) == found


@given(
    order=st.permutations(range(len(CLEAN_DS))),
    sizes=st.sampled_from([(8,), (2, 6), (5, 3), (4, 2, 2), (3, 3, 2), (2, 2, 2, 2)]),
)
def test_however_the_routes_are_parted_the_whole_is_the_same(order: list[int], sizes: tuple[int, ...]) -> None:
    whole = report("vad", {**ALIKE, "occlusion 0.8": 0.5})
    places = iter(order)
    parts = [of_routes(whole, sorted(itertools.islice(places, size)), 30.0) for size in sizes]
    with tempfile.TemporaryDirectory() as folder:
        found = joining.read(saved(Path(folder), *parts))
        assert results.text_of(found) == results.text_of(joining.read(saved(Path(folder), whole)))


def test_a_row_of_one_part_is_driven_again_before_the_parts_are_put_together(tmp_path: Path) -> None:
    whole = report("tcp", ALIKE)
    first, second = (of_routes(whole, places, 30.0) for places in (range(4), range(4, 8)))
    again = of_routes(report("tcp", {**ALIKE, "occlusion 0.5": 0.5}), range(4), 30.0)
    found = joining.read(saved(tmp_path, first, second, again)).agents["tcp"].settings["occlusion 0.5"]
    assert found.driving_score[:4] == pytest.approx([0.5 * score for score in CLEAN_DS[:4]])
    assert found.driving_score[4:] == pytest.approx(CLEAN_DS[4:])


def test_parts_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    whole = report("tcp", ALIKE)
    first, second = of_routes(whole, range(4), 30.0), of_routes(whole, range(4, 8), 30.0)
    with pytest.raises(ComparisonError, match=r"tcp: 1 of its 4 routes \(401\) are in a file before it, .* holds 4"):
        joining.read(saved(tmp_path, first, of_routes(whole, range(3, 7), 30.0)))
    with pytest.raises(ComparisonError, match="vad was driven with seed 0 on 4 routes, tcp with seed 0 on 8"):
        joining.read(saved(tmp_path, first, second, of_routes(report("vad", ALIKE), range(4), 30.0)))
    second["episodes"] = [episode for episode in second["episodes"] if episode["setting"] != "occlusion 0.8"]
    said = (
        "tcp under occlusion 0.8 was driven in one of these only: its 4 routes from 101 to 401, its 4 routes from 501"
    )
    with pytest.raises(ComparisonError, match=re.escape(said)):
        joining.read(saved(tmp_path, first, second))
    third = of_routes(whole, range(4, 8), 30.0)
    third["fingerprint"]["routes"]["501"] = "other"
    with pytest.raises(ComparisonError, match="was driven on other routes 501 than the files before it"):
        joining.read(saved(tmp_path, whole, third))


def on_machine(document: dict[str, Any], facts: dict[str, str]) -> dict[str, Any]:
    moved: dict[str, Any] = json.loads(json.dumps(document))
    for episode in moved["episodes"]:
        episode["versions"] = facts
    return moved


def test_drives_of_machines_that_compute_otherwise_are_not_joined(tmp_path: Path) -> None:
    whole = report("tcp", ALIKE)
    first, second = of_routes(whole, range(4), 30.0), of_routes(whole, range(4, 8), 30.0)
    elsewhere, unknown = on_machine(second, {"machine torch": "4567"}), on_machine(second, {})
    said = "tcp was driven on machines whose torch computes otherwise in these: its 4 routes from 101 to 401, its 4"
    with pytest.raises(ComparisonError, match=said):
        joining.read(saved(tmp_path, first, elsewhere))
    with pytest.raises(ComparisonError, match="torch computes otherwise in these: seed 0, seed 1"):
        joining.read(saved(tmp_path, first, with_seed(on_machine(first, {"machine torch": "4567"}), 1)))
    lacking = report("tcp", {setting: share for setting, share in ALIKE.items() if setting != "occlusion 0.8"})
    with pytest.raises(ComparisonError, match="of another clean run"):
        joining.read(saved(tmp_path, whole, on_machine(lacking, {"machine torch": "4567"})))
    assert joining.read(saved(tmp_path, first, second)).agents["tcp"].machine == {"machine torch": "0123"}
    assert joining.read(saved(tmp_path, first, unknown)).agents["tcp"].machine == {}


def test_the_machine_of_a_report_is_in_the_results(tmp_path: Path) -> None:
    found = joining.read(saved(tmp_path, report("tcp", ALIKE)))
    (tmp_path / "results.json").write_text(results.text_of(found), encoding="utf-8")
    assert joining.read([tmp_path / "results.json"]) == found
    document = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert document["agents"]["tcp"].pop("machine") == {"machine torch": "0123"}
    (former,) = saved(tmp_path, document)
    assert joining.read([former]).agents["tcp"].machine == {}


def test_code_of_another_day_that_drives_the_same_goes_on(tmp_path: Path) -> None:
    whole = as_published("tcp")
    later = json.loads(json.dumps({**whole, "episodes": [e for e in whole["episodes"] if e["setting"] == CLEAN]}))
    later["versions"]["pytest-drive-robust"] = "9.9"
    for made_of in later["fingerprint"]["agents"].values():
        made_of["source"] = "other"
    found = joining.read(saved(tmp_path, whole, later)).agents["tcp"]
    assert set(found.settings) == set(DRIVEN)
    for episode in later["episodes"]:
        episode["driving_score"] *= 0.5
    with pytest.raises(ComparisonError, match="of another clean run"):
        joining.read(saved(tmp_path, whole, later))
