"""`drive-robust replay` says whether an episode is as it was stored, and drives stored controls again."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from replayed_agents import FAKE, GOOD, LATE, ROUTE, SETTINGS, stored
from result_factory import make_result

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.report.json_file import episode_as_json
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.record_files import write_episode


def test_it_says_that_both_are_as_stored(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stored(folder, "clean"), stored(folder, "200 ms latency")
    assert main([*GOOD, *LATE, "--no-video", "--run", "run"]) == 0
    shown = capsys.readouterr().out
    assert "clean: as in the folder run, bit for bit" in shown
    assert "200 ms latency: as in the folder run, bit for bit" in shown


def test_it_exits_with_1_when_the_agent_drives_otherwise_than_stored(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from pytest_drive_robust.store.record_files import read_episode

    path = stored(folder, "200 ms latency")
    result = read_episode(path)
    rows = result.trace.rows.copy()
    rows[9:, 0] += 0.25
    write_episode(path, replace(result, trace=replace(result.trace, rows=rows)))
    assert main([*GOOD, *LATE, "--no-video", "--run", "run"]) == 1
    shown = capsys.readouterr().out
    assert "clean: not in the folder run" in shown
    assert "200 ms latency: DIFFERS from the folder run from 0.50 s on" in shown


def test_a_damaged_file_is_named_where_no_other_holds_the_episode(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored(folder, "clean")
    torn = folder / "run" / "episodes" / "torn.episode"
    torn.write_bytes(b"torn")
    assert main([*GOOD, "--no-video", "--run", "run"]) == 0
    torn.rename(stored(folder, "clean"))
    assert main([*GOOD, "--no-video", "--run", "run"]) == 4
    assert "cannot be read: it does not begin as a stored episode does" in capsys.readouterr().err


def test_a_stored_run_is_asked_by_its_name_and_the_newest_one_anyway(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from pytest_drive_robust.store.record_files import read_episode

    path = stored(folder, "200 ms latency")
    result = read_episode(path)
    episode = episode_as_json("of a run", result)
    runs = folder / ".drive-robust" / "runs"
    runs.mkdir(parents=True)
    for name, digest in (("before", episode["trace_digest"]), ("later", "of another drive")):
        document = {
            "schema": 1,
            "settings": SETTINGS,
            "summaries": [],
            "episodes": [{**episode, "trace_digest": digest}],
        }
        (runs / f"{name}.json").write_text(json.dumps(document))
        os.utime(runs / f"{name}.json", (len(name), len(name)))  # `before` is the newest
    assert main([*GOOD, *LATE, "--no-video", "--run", "before"]) == 0
    assert "200 ms latency: as in the run before, bit for bit" in capsys.readouterr().out
    assert main([*GOOD, *LATE, "--no-video", "--run", "later"]) == 1
    assert "200 ms latency: DIFFERS from the run later" in capsys.readouterr().out
    assert main([*GOOD[:-2], *LATE, "--no-video"]) == 0, "nobody asked whether it is the same"
    assert "200 ms latency: DIFFERS from the run before" in capsys.readouterr().out
    assert main([*GOOD, *LATE, "--no-video"]) == 0
    assert "the run before" not in capsys.readouterr().out, "no run ends after 40 ticks"


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"simulator": FAKE, "stuck_stop_s": None}, True),
        ({"simulator": "embedded", "stuck_stop_s": None}, False),
        ({"simulator": FAKE, "stuck_stop_s": 30.0}, False),
    ],
)
def test_the_newest_run_is_no_comparison_where_it_was_driven_otherwise(
    settings: dict[str, object], told: bool, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = make_result(ROUTE.id, agent="film_agents:Good")
    episode = {**episode_as_json("of a run", result), "trace_digest": "of another drive"}
    document = {"schema": 1, "settings": {**SETTINGS, **settings}, "summaries": [], "episodes": [episode]}
    runs = folder / ".drive-robust" / "runs"
    runs.mkdir(parents=True)
    (runs / "one.json").write_text(json.dumps(document))
    assert main([*GOOD[:-2], "--no-video"]) == 0
    assert ("DIFFERS from the run one" in capsys.readouterr().out) == told


def test_a_run_is_found_as_everywhere_by_a_file_of_any_name(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = {"schema": 1, "settings": SETTINGS, "summaries": [], "episodes": []}
    (folder / "run").write_text(json.dumps(document))
    assert main([*GOOD, "--no-video", "--run", "run"]) == 4
    shown = capsys.readouterr()
    assert "the run run holds no " in shown.err
    assert "so nothing could be compared: it holds 0 episodes" in shown.err
    assert shown.out == ""  # nothing was driven
    assert main([*GOOD, "--no-video", "--run", "gone.json"]) == 4
    assert "--run is 'gone.json', but there is no such file or folder" in capsys.readouterr().err


def test_a_run_over_another_route_of_that_id_is_no_comparison(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from pytest_drive_robust.runner.cache_key.identity import route_digest
    from pytest_drive_robust.store.record_files import read_episode

    result = read_episode(stored(folder, "200 ms latency"))
    episode = {**episode_as_json("of a run", result), "trace_digest": "of another drive"}
    for digest, told in ((route_digest(ROUTE), "DIFFERS from the run"), ("another", "not in the run")):
        fingerprint = {"agents": {}, "routes": {ROUTE.id: digest}}
        document = {
            "schema": 1,
            "settings": SETTINGS,
            "summaries": [],
            "episodes": [episode],
            "fingerprint": fingerprint,
        }
        (folder / "run.json").write_text(json.dumps(document))
        code = main([*GOOD, *LATE, "--no-video", "--run", "run.json"])
        shown = capsys.readouterr()
        assert f"200 ms latency: {told}" in shown.out
        assert code == (1 if told == "DIFFERS from the run" else 4)
    assert "the run run.json holds nothing of what was driven, so nothing was compared: it holds 1 episode" in shown.err


def test_a_stored_episode_on_another_route_of_that_id_is_no_comparison(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = replace(resolve_routes("2901")[0], id=ROUTE.id)
    path = stored(folder, "clean", own)
    for arguments in (["replay", str(path), "--sim", FAKE, "--tick-cap", "40"], [*GOOD, "--run", "run"]):
        save_routes([own], folder / "own.xml")
        assert main([*arguments, "--no-video", "--routes", "own.xml"]) == 0
        (folder / "own.xml").unlink()
        assert main([*arguments, "--no-video"]) == 4
        shown = capsys.readouterr()
        assert shown.out.count("bit for bit") == 1
        assert "holds nothing of what was driven, so nothing was compared: " in shown.err
        if "--run" not in arguments:
            told = f"it is of another route {ROUTE.id}, ParkingExit of 135 m. Name its file with --routes."
            assert told in shown.err


def test_a_store_also_holds_what_earlier_versions_of_an_agent_drove(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from pytest_drive_robust.store.folder import FolderStore
    from pytest_drive_robust.store.record_files import read_episode

    result = read_episode(stored(folder, "clean"))
    earlier = replace(result, trace=replace(result.trace, rows=result.trace.rows + 1.0))
    store = FolderStore(folder / "store")
    store.put("aa01", earlier)
    assert main([*GOOD, "--no-video", "--run", "store"]) == 1
    store.put("aa02", result)
    store.put("aa03", earlier)
    assert main([*GOOD, "--no-video", "--run", "store"]) == 0
    shown = capsys.readouterr().out
    assert "clean: DIFFERS from the folder store" in shown
    assert "clean: as in the folder store, bit for bit" in shown


def test_where_it_drives_otherwise_than_all_of_a_store_the_newest_is_told_of(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from pytest_drive_robust.store.record_files import read_episode

    path = stored(folder, "clean")
    result = read_episode(path)
    for changed_s, age_s in ((1.0, 1), (0.5, 9), (1.5, 5)):
        rows = result.trace.rows.copy()
        rows[round(changed_s / result.dt_s) - 1 :, 0] += 0.25
        earlier = path.with_stem(f"drive-{age_s}")
        write_episode(earlier, replace(result, trace=replace(result.trace, rows=rows)))
        os.utime(earlier, (age_s, age_s))
    path.unlink()
    assert main([*GOOD, "--no-video", "--run", "run"]) == 1
    assert "clean: DIFFERS from the folder run from 0.50 s on" in capsys.readouterr().out


def test_a_stored_episode_says_itself_what_to_drive(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = stored(folder, "200 ms latency")
    assert main(["replay", str(path), "--sim", FAKE, "--tick-cap", "40", "--no-video"]) == 0
    shown = capsys.readouterr().out
    assert f"film_agents:Good on {ROUTE.id} under 200 ms latency, seed 0" in shown
    assert "200 ms latency: as in the stored episode, bit for bit" in shown


def test_a_stored_episode_is_compared_with_the_run_that_was_named(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from pytest_drive_robust.store.record_files import read_episode

    path = stored(folder, "200 ms latency")
    result = read_episode(path)
    rows = result.trace.rows.copy()
    rows[9:, 0] += 0.25
    (folder / "other").mkdir()
    write_episode(folder / "other" / path.name, replace(result, trace=replace(result.trace, rows=rows)))
    arguments = ["replay", str(path), "--sim", FAKE, "--tick-cap", "40", "--no-video"]
    assert main([*arguments, "--run", "run"]) == 0
    assert main([*arguments, "--run", "other"]) == 1
    shown = capsys.readouterr().out
    assert "200 ms latency: as in the folder run, bit for bit" in shown
    assert "200 ms latency: DIFFERS from the folder other from 0.50 s on" in shown


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["--seed", "7"], ""),
        (["--setting", "500 ms latency"], ""),
        (["--setting", "500 ms latency", "--run", "run"], "500 ms latency: not in the folder run"),
        (["--seed", "0"], "200 ms latency: as in the stored episode, bit for bit"),
    ],
)
def test_options_that_make_another_episode_of_a_stored_one_compare_with_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str], given: list[str], told: str
) -> None:
    stored(folder, "clean")
    path = stored(folder, "200 ms latency")
    assert main(["replay", str(path), "--sim", FAKE, "--tick-cap", "40", "--no-video", *given]) == 0
    shown = capsys.readouterr().out
    assert told in shown
    assert bool(told) == ("stored episode" in shown or "folder run" in shown)


def test_stored_controls_are_driven_again_without_the_agent(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = stored(folder, "200 ms latency")
    (folder / "film_agents.py").unlink()
    monkeypatch.delitem(sys.modules, "film_agents")
    arguments = ["replay", str(path), "--sim", FAKE, "--tick-cap", "40", "--no-video"]
    assert main(arguments) == 4
    assert main([*arguments, "--stored-controls"]) == 0
    assert "200 ms latency: as in the stored episode, bit for bit" in capsys.readouterr().out
    for given in (["--agent", "expert"], ["--setting", "clean"], ["--seed", "0"]):
        assert main([*arguments, "--stored-controls", *given]) == 4
        assert f"--stored-controls and {given[0]} cannot be combined" in capsys.readouterr().err


def test_stored_controls_differ_also_where_the_latency_was_measured(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = stored(folder, "measured latency")
    arguments = ["replay", str(path), "--sim", FAKE, "--no-video", "--stored-controls", "--tick-cap"]
    assert main([*arguments, "40"]) == 0
    assert main([*arguments, "20"]) == 1
    shown = capsys.readouterr().out
    assert "measured latency: DIFFERS from the stored episode only in length: 1.00 s now, 2.00 s stored" in shown
    assert "never the same twice" not in shown
