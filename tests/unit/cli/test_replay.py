"""`drive-robust replay` from the command line to the file that it writes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import cv2
import pytest
from replayed_agents import FAKE, GOOD, LATE, ROUTE

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.report.film.file_name import film_name
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.testing import FakeSimulator

REPOSITORY = Path(__file__).parents[3]

pytestmark = pytest.mark.usefixtures("folder")


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
