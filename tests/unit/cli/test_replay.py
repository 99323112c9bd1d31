"""`drive-robust replay` from the command line to the file that it writes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import pytest
from result_factory import make_result

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.report.film.file_name import film_name
from pytest_drive_robust.report.json_file import episode_as_json
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.record_files import write_episode
from pytest_drive_robust.testing import FakeSimulator

REPOSITORY = Path(__file__).parents[3]
FAKE = "pytest_drive_robust.testing:FakeSimulator"
SETTINGS = {"simulator": FAKE, "metrics": "bench2drive"}
AGENTS = """
from pytest_drive_robust import CameraSpec, Control, PlannedPath

class Good:
    def sensors(self): return [CameraSpec("front")]
    def reset(self, route, seed): pass
    def act(self, observation): return Control(throttle=1.0, steer=max(-1.0, min(1.0, -0.1 * observation.gps.y_m)))
    def plan(self): return PlannedPath(path=((0.0, 0.0), (20.0, 0.0)))

class Secretive(Good):
    def plan(self): raise RuntimeError("not telling")

class Bad(Good):
    def act(self, observation): return None

class OneThreaded(Good):
    def act(self, observation):
        import cv2
        assert cv2.getNumThreads() == 1, "as in a worker process"
        return super().act(observation)

class Slow(Good):
    def act(self, observation):
        return Control(throttle=0.2, steer=0.001 * observation.speed.mps)

class Jumpy(Good):
    def act(self, observation):
        assert observation.tick < 2 or abs(observation.gps.y_m) < 0.1, "far from its route"
        return Control(throttle=0.2)

class Debugged(Good):
    def act(self, observation):
        if observation.tick == 5:
            breakpoint()
        return super().act(observation)
"""
ROUTE = resolve_routes("full")[0]
GOOD = ("replay", ROUTE.id, "--agent", "film_agents:Good", "--sim", FAKE, "--tick-cap", "40")
LATE = ("--setting", "200 ms latency")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "film_agents.py").write_text(AGENTS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "film_agents", raising=False)
    return tmp_path


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} - {"film_agents.py", "__pycache__"}


def test_it_films_both_episodes_from_outside(folder: Path) -> None:
    av = pytest.importorskip("av")
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest_drive_robust.cli",
            *GOOD[:4],
            *LATE,
            "--tick-cap",
            "30",
            "--out",
            "film.mp4",
        ],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join((str(REPOSITORY), str(folder)))},
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert f"under 200 ms latency, seed 0 ({ROUTE.scenario.type})" in done.stdout
    assert "film.mp4: " in done.stdout
    assert files(folder) == {"film.mp4"}
    with av.open(str(folder / "film.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) > 31
    assert frames[0].shape == (720, 1280, 3)
    assert abs(frames[0].astype(int) - frames[-1]).max() > 100


def test_the_file_is_named_after_its_episode(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("av")
    assert main([*GOOD, *LATE]) == 0
    name = film_name(Episode("film_agents:Good", ROUTE.id, "200 ms latency", 0))
    assert name.startswith(f"replay-film_agents-good-{ROUTE.id}-200-ms-latency-seed0-")
    assert files(folder) == {name}
    assert f"{name}: " in capsys.readouterr().out


@pytest.mark.usefixtures("two_threads")
def test_libraries_compute_on_one_thread_as_in_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*(part.replace("Good", "OneThreaded") for part in GOOD), "--no-video"]) == 0
    assert "agent_error" not in capsys.readouterr().out
    assert cv2.getNumThreads() == 2


def test_films_of_two_agents_and_two_seeds_do_not_replace_each_other(folder: Path) -> None:
    pytest.importorskip("av")
    other = [part.replace("Good", "Slow") for part in GOOD]
    for arguments in (GOOD, other, [*GOOD, "--seed", "1"]):
        assert main([*arguments]) == 0
    assert len(files(folder)) == 3


def test_without_an_encoder_a_strip_of_pictures_takes_its_place(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    assert main([*GOOD, *LATE, "--out", "film.mp4"]) == 0
    captured = capsys.readouterr()
    assert "no H.264 encoder is installed, so the telling moments go to film.png" in captured.err
    assert "pip install 'pytest-drive-robust[video]'" in captured.err
    assert files(folder) == {"film.png"}
    picture = cv2.imread("film.png")
    assert picture is not None
    assert picture.shape == (1440, 2560, 3)  # start, divergence, end


@pytest.mark.parametrize(
    ("agent", "told"), [("Good", "both drove the same"), ("Slow", "no divergence: never 0.5 m or 1 m/s apart")]
)
def test_two_that_never_part_are_the_same_or_nearly(agent: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [part.replace("Good", agent) for part in GOOD]
    assert main([*arguments, "--setting", "speed noise 0.9", "--no-video"]) == 0
    assert told in capsys.readouterr().out


def test_two_that_ended_apart_are_told_how_long_they_are_compared(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [part.replace("Good", "Jumpy") for part in GOOD]
    assert main([*arguments, "--setting", "GPS noise 15 m", "--no-video"]) == 0
    assert "no divergence in the 0.10 s that both drove: never 0.5 m or 1 m/s apart" in capsys.readouterr().out


def test_no_bar_is_drawn_over_the_prompt_of_a_debugger(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = []

    def prompt(*_: object) -> None:
        capsys.readouterr()
        time.sleep(0.3)  # a bar is drawn ten times a second
        drawn.append(capsys.readouterr().err)

    monkeypatch.setenv("FORCE_COLOR", "1")  # as on a terminal
    monkeypatch.setattr(sys, "breakpointhook", prompt)
    arguments = [part.replace("Good", "Debugged") for part in GOOD]
    assert main([*arguments, "--no-video"]) == 0
    assert drawn == [""]
    assert sys.breakpointhook is prompt


def test_nothing_is_written_when_nobody_wants_a_film(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*GOOD, *LATE, "--no-video"]) == 0
    assert files(folder) == set()
    assert "first divergence at " in capsys.readouterr().out


def test_a_clean_replay_is_one_episode_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*GOOD, "--out", "alone.png"]) == 0
    assert capsys.readouterr().out.count("under clean") == 1
    assert files(folder) == {"alone.png"}


def test_an_agent_that_cannot_tell_its_plan_is_filmed_without(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [part.replace("Good", "Secretive") for part in GOOD]
    assert main([*arguments, "--out", "film.png"]) == 0
    assert "no plan is shown: plan raised RuntimeError: not telling" in capsys.readouterr().out


def stored(folder: Path, sentence: str, route: Route = ROUTE) -> Path:
    """The episode that GOOD drives under a setting, as a run stores it."""
    sys.path.insert(0, str(folder))
    from film_agents import Good  # type: ignore[import-not-found]

    setting = Setting.parse(sentence)
    result = drive_episode(
        FakeSimulator(SimulatorOptions(tick_cap=40)),
        Good(),
        route=route,
        setting=setting,
        seed=0,
        agent_name="film_agents:Good",
    )
    (folder / "run" / "episodes").mkdir(parents=True, exist_ok=True)
    path = folder / "run" / "episodes" / f"{EpisodeRequest(result.episode, route, setting).key}.episode"
    write_episode(path, result)
    return path


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
    assert "the run run holds nothing of what was driven" in capsys.readouterr().err
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


def test_replay_shows_both_episodes_and_where_they_part(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["replay", ROUTE.id, "--agent", "film_agents:Good", "--sim", FAKE, "--setting", "200 ms latency"]
    assert main([*arguments, "--seed", "5", "--no-video"]) == 0
    shown = capsys.readouterr().out
    assert f"film_agents:Good on {ROUTE.id} under clean, seed 5 ({ROUTE.scenario.type})" in shown
    assert f"film_agents:Good on {ROUTE.id} under 200 ms latency, seed 5" in shown
    assert shown.count("completed: DS ") == 2
    assert "first divergence at " in shown


def test_replay_of_the_clean_setting_drives_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", ROUTE.id, "--agent", "film_agents:Bad", "--sim", FAKE, "--no-video"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("under clean") == 1
    assert "agent_error" in shown
    assert "first divergence" not in shown


def test_replay_of_a_baseline_with_a_warm_up_drives_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*GOOD, "--setting", "0 ms latency (reading=released)", "--no-video"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("under 0 ms latency (reading=released)") == 1
    assert "both drove the same" not in shown


def test_no_share_of_the_way_is_made_up_where_the_simulation_broke(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FakeSimulator, "score", lambda self: 1 / 0)
    assert main([*GOOD, "--no-video"]) == 0
    assert "  infra_error: not scored\n" in capsys.readouterr().out


def test_a_replay_stops_early_where_the_run_did(capsys: pytest.CaptureFixture[str]) -> None:
    route = next(route.id for route in resolve_routes("full") if route.scenario.type == "ParkedObstacle")
    arguments = ["replay", route, "--agent", "drive_robust_agents.constant:Constant", "--no-video", "--stuck-stop"]
    assert main([*arguments, "5"]) == 0
    assert "stopped early" in capsys.readouterr().out
    assert main([*arguments, "soon"]) == 4
    assert "--stuck-stop is 'soon', expected seconds > 0" in capsys.readouterr().err


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


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({1: "10l"}, "no route named '10l'. Did you mean"),
        ({3: "film_agents:Goood"}, "Good"),
        ({3: "clasical"}, "Did you mean 'classical'"),
        ({"--setting": "200 ms latncy"}, "latency"),
        ({"--setting": "20 ms latency"}, "20"),
        ({"--out": "film.avi"}, "--out is 'film.avi', expected the name of a .mp4 or .png file"),
        ({"--out": "nowhere/film.mp4"}, "there is no folder 'nowhere'"),
        ({"--run": "nowhere/"}, "no such file or folder"),
        ({"--run": "befor"}, "no stored run named 'befor'"),
        ({"--tick-cap": "0"}, "expected at least 1"),
        ({"--seed": "0", "--stored-controls": ""}, "Give its .episode file as ROUTE"),
        ({1: "gone.episode"}, "there is no episode file 'gone.episode'"),
        ({"--setting=": ""}, "--setting is empty, expected SENTENCE: "),
        ({"--run=": ""}, "--run is empty, expected"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_bad_input_exits_with_4_and_writes_nothing(
    changed: dict[int | str, str], told: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = list(GOOD)
    for place, value in changed.items():
        if isinstance(place, int):
            arguments[place] = value
        else:
            arguments += [place, value] if value else [place]
    assert main(arguments) == 4
    error = capsys.readouterr().err
    assert told in error
    assert error.startswith("drive-robust: ")
    assert files(folder) == set()


def test_an_agent_must_be_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", ROUTE.id]) == 4
    assert "--agent is missing" in capsys.readouterr().err


@pytest.mark.parametrize("seed", [-1, 2**53])
def test_a_seed_that_no_run_takes_is_refused(folder: Path, capsys: pytest.CaptureFixture[str], seed: int) -> None:
    assert main([*GOOD, f"--seed={seed}", "--no-video"]) == 4
    assert f"--seed holds {seed}, expected" in capsys.readouterr().err
