"""Official evaluators are started and read, and their results become episodes (here: a stand-in for them)."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_bench2drive import ROUTES
from patience import PATIENCE_S

from pytest_drive_robust.bench2drive.evaluator.__main__ import main
from pytest_drive_robust.bench2drive.results.official_record import STATUSES
from pytest_drive_robust.bench2drive.results.results_file import read_results
from pytest_drive_robust.cli.main import main as drive_robust
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.errors import PerturbationError, UnknownNameError, UsageError
from pytest_drive_robust.perturbations import Perturbation, Setting
from pytest_drive_robust.runner.plan import EpisodeRequest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="CARLA's evaluator is watched through /proc")


def test_a_run_scores_every_route_and_the_second_run_drives_none(
    official_run: Callable[..., Any], tmp_path: Path
) -> None:
    code, told = official_run("ok", "--setting", "GPS noise 5 m and 100 ms latency", "--seed", "4", "--slots", "2")
    assert code == 0, told
    (results,) = tmp_path.glob("out/*/results")
    assert str(results) in told
    found = read_results(results)
    assert {record.route for record in found.records} == set(ROUTES)
    assert (found.planned, found.missing, found.unfinished) == (3, (), ())
    before = {path: path.stat().st_mtime_ns for path in results.glob("*.json")}
    code, told = official_run("ok", "--setting", "GPS noise 5 m and 100 ms latency", "--seed", "4")
    assert code == 0
    assert {path: path.stat().st_mtime_ns for path in results.glob("*.json")} == before


def test_the_agent_is_driven_under_the_setting_in_the_evaluators_environment(
    official_run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBUSTNESS_ENABLE", "1")
    monkeypatch.setenv("GPS_NOISE_STD", "99")
    route = f"{tmp_path}/b2d/leaderboard/data/bench2drive220.xml:202"
    setting = "GPS noise 5 m and 100 ms latency"
    code, told = official_run("ok", "--setting", setting, "--seed", "4", "--routes", route, "--gpu", "3")
    assert code == 0, told
    (folder,) = (tmp_path / "out").iterdir()
    drive = json.loads((folder / "results/drive-202.json").read_text())
    assert [throttle for throttle, _ in drive["applied"]] == [0.0, 0.0, *((tick + 1) / 100 for tick in range(28))]
    clean = [[0.001 * np.random.RandomState(frame).rand(), 0.002, 3.0] for frame in range(50, 80)]
    off_m = (np.array([seen[0] for seen in drive["seen"]]) - clean)[:, :2] * 111_195
    assert 3.0 < off_m.std() < 7.0
    assert drive["tm_seed"] == 4
    assert drive["env"]["CUDA_VISIBLE_DEVICES"] == "3"
    assert drive["env"]["SCENARIO_RUNNER_ROOT"] == str(tmp_path / "b2d/scenario_runner")
    (line,) = (folder / "injected/202.jsonl").read_text().splitlines()
    assert json.loads(line)["schedule"] == [["gps-noise", "gps", 0, 29], ["inference-latency", "control", 0, 29]]


@pytest.mark.parametrize("setting", ["GPS noise 5 m", "100 ms latency"])
def test_a_score_without_a_sign_that_anything_failed_is_no_result(
    setting: str, official_executor: Callable[..., Any], tmp_path: Path
) -> None:
    made, task = official_executor(tries=2)
    request = task("no-cleanup", Setting.parse(setting))
    result = made.submit(request).result(PATIENCE_S)
    assert result.outcome is Outcome.INFRA_ERROR
    assert result.end_detail.count(f"Completed, but nothing tells that '{setting}' was injected") == 2
    assert made.finished(request) is None
    assert made.submit(task("no-cleanup")).result(PATIENCE_S).outcome is Outcome.COMPLETED  # nothing was to fail


def test_an_agent_that_the_failures_do_not_reach_is_refused(official_executor: Callable[..., Any]) -> None:
    made, task = official_executor(tries=2)
    for setting in ("GPS noise 5 m", "GPS noise 5 m and 200 ms latency (reading=released)"):
        told = rf"drove 30 ticks and read no sensors.*'{re.escape(setting)}' did not reach it"
        with pytest.raises(UsageError, match=told):
            made.submit(task("looks-elsewhere", Setting.parse(setting))).result(PATIENCE_S)
    late = made.submit(task("looks-elsewhere", Setting.parse("100 ms latency"))).result(PATIENCE_S)
    assert late.outcome is Outcome.COMPLETED  # its commands are late all the same


def test_a_finished_result_whose_log_tells_nothing_of_its_injection_is_refused(
    official_executor: Callable[..., Any], tmp_path: Path
) -> None:
    made, task = official_executor()
    request = task("ok", Setting.parse("GPS noise 5 m"))
    assert made.submit(request).result(PATIENCE_S).outcome is Outcome.COMPLETED
    (log,) = tmp_path.glob("runs/*/injected/101.jsonl")
    entry = json.loads(log.read_text())
    damaged = (
        {"schedule": [["gps-noise", "gps", 0]]},
        {"schedule": [None]},
        {"inference_s": ["soon"]},
        {"reception": {"cameras": []}},
        {"injected_ticks": "many"},
        {"route": "202"},
        {"setting": "GPS noise 15 m"},
        {"seed": 1},
    )
    texts = [json.dumps({**entry, **changed}) for changed in damaged]
    for text in ("", "[]", "[" * 100_000, json.dumps(entry)[:80], *texts, None):
        log.unlink() if text is None else log.write_text(text)
        with pytest.raises(UsageError, match=r"101.json' is not a finished result: .*101.jsonl' does not tell"):
            made.finished(request)
    log.write_text(json.dumps(entry))
    assert made.finished(request).outcome is Outcome.COMPLETED


def test_an_agent_imports_packages_in_the_root_of_the_checkout(
    official_run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    agent, package = tmp_path / "own_agent.py", tmp_path / "b2d/Bench2DriveZoo/team_code"
    package.mkdir(parents=True)
    (package / "pid_controller.py").write_text("")
    agent.write_text("import Bench2DriveZoo.team_code.pid_controller\n" + agent.read_text())
    route = f"{tmp_path}/b2d/leaderboard/data/bench2drive220.xml:101"
    code, told = official_run("ok", "--routes", route, "--tries", "1")
    assert code == 0, told


OLD_PYTHON = os.environ.get("PDR_TEST_OLD_PYTHON", "")
"""An interpreter as CARLA's clients need it, 3.7 or later, that has numpy and nothing else."""


@pytest.mark.skipif(not OLD_PYTHON, reason="PDR_TEST_OLD_PYTHON names no Python with numpy")
def test_an_old_python_is_given_the_same_to_the_last_bit(official_run: Callable[..., Any], tmp_path: Path) -> None:
    route = f"{tmp_path}/b2d/leaderboard/data/bench2drive220.xml:202"
    setting = (
        "1 s burst frame drop (probability=0.3) and occlusion 0.5 (fill=blur) and GPS noise 5 m and "
        "speed noise 0.2 and 100 ms sensor delay and 3 frame blend and 200 ms latency (mode=hold)"
    )
    told = []
    for name, python in (("ours", sys.executable), ("old", OLD_PYTHON)):
        given = ("--setting", setting, "--routes", route, "--python", python, "--out", str(tmp_path / name))
        code, said = official_run("ok", *given)
        assert code == 0, said
        (folder,) = (tmp_path / name).iterdir()
        drive = json.loads((folder / "results/drive-202.json").read_text())
        told.append((drive["seen"], drive["applied"], (folder / "injected/202.jsonl").read_text()))
    assert 0 < len(told[0][0]) < 30  # the agent is busy in the other ticks
    assert told[0] == told[1]


def test_routes_without_a_score_are_missing_in_the_results(
    official_run: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, told = official_run("crash-in:303", "--tries", "1")
    assert code == 1
    (results,) = tmp_path.glob("out/*/results")
    file = tmp_path / "b2d/leaderboard/data/bench2drive220.xml"
    assert f"2 of 3 routes have a score: drive-robust score {results} --routes {file}\n" in told
    assert read_results(results).missing == ("303",)
    assert drive_robust(["score", str(results), "--metrics", "fixed"]) == 0
    assert "1  missing: 303" in capsys.readouterr().out


def test_commands_of_other_routes_share_what_was_planned(official_run: Callable[..., Any], tmp_path: Path) -> None:
    file = tmp_path / "b2d/leaderboard/data/bench2drive220.xml"
    code, told = official_run("crash-in:101", "--routes", f"{file}:101,101", "--tries", "1", "--slots", "2")
    assert code == 1
    assert "0 of 1 routes have a score" in told
    assert official_run("crash-in:101", "--routes", f"{file}:202", "--tries", "1")[0] == 0
    (results,) = tmp_path.glob("out/*/results")
    assert read_results(results).missing == ("101",)


@pytest.mark.parametrize(
    ("config", "text"),
    [
        ("ckpt/bset.pth", "there is no 'ckpt/bset.pth' (did you mean"),
        ("settings.py+bset.pth", "there is no 'bset.pth'"),
    ],
)
def test_a_mistyped_checkpoint_is_refused_before_anything_is_driven(
    config: str, text: str, official_run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ckpt").mkdir()
    (tmp_path / "ckpt/best.pth").write_text("")
    (tmp_path / "b2d/settings.py").write_text("")  # the evaluator runs there
    monkeypatch.chdir(tmp_path)
    code, told = official_run(config)
    assert code == 4
    assert text in told
    assert not (tmp_path / "out").exists()


def test_the_agent_and_its_checkpoint_may_be_in_the_home_folder(
    official_executor: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, task = official_executor()
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "best.pth").write_text("")
    wanted = task("ok")
    episode = Episode("leaderboard:~/own_agent.py+~/best.pth", ROUTES[0], "clean", 0)
    result = made.submit(EpisodeRequest(episode, wanted.route, Setting.CLEAN)).result(PATIENCE_S)
    assert result.outcome is Outcome.COMPLETED
    (log,) = tmp_path.glob("runs/*/results/drive-101.json")
    assert json.loads(log.read_text())["env"]["TEAM_CONFIG"] == str(tmp_path / "best.pth")


def test_a_checkpoint_whose_path_agents_would_take_apart_is_refused_and_a_link_to_it_is_not(
    official_run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weights = tmp_path / "lr3+long" / "best.pth"
    weights.parent.mkdir()
    weights.write_text("")
    monkeypatch.chdir(weights.parent)
    code, told = official_run("best.pth")
    assert code == 4
    assert f"'best.pth' of the agent is '{weights}', which official agents take apart at each '+'" in told
    monkeypatch.chdir(tmp_path)
    (tmp_path / "best.pth").symlink_to(weights)
    route = f"{tmp_path}/b2d/leaderboard/data/bench2drive220.xml:101"
    assert official_run("best.pth", "--routes", route)[0] == 0
    (log,) = tmp_path.glob("out/*/results/drive-101.json")
    assert json.loads(log.read_text())["env"]["TEAM_CONFIG"] == str(tmp_path / "best.pth")


def test_a_run_in_which_the_agent_always_breaks_is_no_success(official_run: Callable[..., Any]) -> None:
    file = "status:Failed - Agent couldn't be set up"
    code, told = official_run(file)
    assert code == 1
    assert "3 of 3 routes have a score" in told
    assert "3 of them ended as an error of the agent: " in told


def test_a_route_that_two_commands_want_is_driven_once(official_executor: Callable[..., Any], tmp_path: Path) -> None:
    (one, task), (other, _) = official_executor(), official_executor(port=24700)
    futures = [made.submit(task("ok")) for made in (one, other)]
    assert [future.result(PATIENCE_S).outcome for future in futures] == [Outcome.COMPLETED] * 2
    assert len((tmp_path / "carla/started").read_text().splitlines()) == 1


def test_a_route_id_that_is_no_number_is_refused_before_anything_is_driven(
    official_run: Callable[..., Any], tmp_path: Path
) -> None:
    file = tmp_path / "b2d/leaderboard/data/bench2drive220.xml"
    file.write_text(file.read_text().replace('id="303"', 'id="own"'))
    code, told = official_run("ok")
    assert code == 4
    assert "the route id 'own' is not a number" in told
    assert not (tmp_path / "out").exists()


def test_results_of_another_setting_lie_beside(official_run: Callable[..., Any], tmp_path: Path) -> None:
    route = f"{tmp_path}/b2d/leaderboard/data/bench2drive220.xml:101"
    for setting in ("clean", "occlusion 0.5"):
        assert official_run("ok", "--routes", route, "--setting", setting)[0] == 0
    assert len(list(tmp_path.glob("out/*/results/101.json"))) == 2


def test_every_official_status_is_an_outcome_and_harness_errors_are_no_scores(
    official_executor: Callable[..., Any],
) -> None:
    made, task = official_executor(tries=1, slots=4)
    futures = {status: made.submit(task(f"status:{status}")) for status in STATUSES}
    for status, future in futures.items():
        result = future.result(PATIENCE_S)
        assert (result.outcome, result.end) == STATUSES[status]
        if result.outcome is Outcome.INFRA_ERROR:
            assert result.ticks == 0
            assert status in result.end_detail
        else:
            assert result.route_completion_pct == (100 if status in ("Completed", "Perfect") else 40)
            assert (result.ticks, result.episode.route_id) == (30, ROUTES[0])


def test_an_evaluator_that_cannot_start_is_the_users_to_put_right(
    official_executor: Callable[..., Any], tmp_path: Path, process_mark: str
) -> None:
    made, task = official_executor()
    with pytest.raises(UsageError, match=r"a_module_that_is_not_there.*doctor"):
        made.submit(task("no-module")).result(PATIENCE_S)


def test_tasks_that_the_evaluator_cannot_have_are_refused(official_executor: Callable[..., Any]) -> None:
    class Fog(Perturbation):
        phrase = "fog"

    made, task = official_executor()
    good = task("ok")
    other = made.routes[1]
    wrong = [
        (
            EpisodeRequest(Episode("expert", ROUTES[0], "clean", 0), good.route, Setting.CLEAN),
            UsageError,
            "leaderboard:",
        ),
        (
            EpisodeRequest(Episode("leaderboard:no.py", ROUTES[0], "clean", 0), good.route, Setting.CLEAN),
            UsageError,
            "no agent file",
        ),
        (task("ok", Setting.of(Fog())), PerturbationError, "fog"),
        (
            EpisodeRequest(good.episode, type(other)("9", "Town12", (), other.scenario), Setting.CLEAN),
            UnknownNameError,
            "'9'",
        ),
        (
            EpisodeRequest(good.episode, type(other)("202", "Town01", (), other.scenario), Setting.CLEAN),
            UsageError,
            "Town01",
        ),
        (
            EpisodeRequest(good.episode, replace(good.route, waypoints=good.route.waypoints[1:]), Setting.CLEAN),
            UsageError,
            "route 101 is another one for the test",
        ),
    ]
    made.check([good])
    for item, error, text in wrong:
        with pytest.raises(error, match=text):
            made.check([item])
        assert isinstance(made.submit(item).exception(30), UsageError)


@pytest.mark.parametrize(
    ("line", "value", "refused"),
    [
        ("os.environ.get('PLANNER_TYPE', None)", None, True),
        ("os.environ['PLANNER_TYPE']", "", True),
        ('os.getenv("PLANNER_TYPE")', None, True),
        ("os.environ.get('PLANNER_TYPE', None)", "only_traj", False),
        ("os.environ.get('PLANNER_TYPE', 'only_ctrl')", None, False),
    ],
)
def test_an_agent_that_needs_a_planner_type_is_refused_without_one(
    line: str,
    value: str | None,
    refused: bool,
    official_run: Callable[..., Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("PLANNER_TYPE", raising=False)
    if value is not None:
        monkeypatch.setenv("PLANNER_TYPE", value)
    with (tmp_path / "own_agent.py").open("a") as file:
        file.write(f"import os\nPLANNER_TYPE = {line}\n")
    code, told = official_run("ok", "--routes", f"{tmp_path}/b2d/leaderboard/data/bench2drive220.xml:101")
    assert code == (4 if refused else 0)
    assert ("export PLANNER_TYPE=only_traj" in told) is refused
    assert (tmp_path / "out").exists() is not refused


@pytest.mark.parametrize(("variable", "used"), [("2,5", {"2", "5"}), ("", {"0"})])
def test_slots_use_the_visible_gpus_in_turn(
    variable: str,
    used: set[str],
    official_executor: Callable[..., Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", variable)
    made, task = official_executor(slots=2)
    for future in [made.submit(task("ok", route=number)) for number in (0, 1)]:
        future.result(PATIENCE_S)
    drives = [json.loads(path.read_text()) for path in tmp_path.glob("runs/*/results/drive-*.json")]
    assert {drive["env"]["CUDA_VISIBLE_DEVICES"] for drive in drives} == used


def test_gpus_that_carla_cannot_be_told_are_refused(
    official_run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "GPU-8f1c")
    code, told = official_run("ok")
    assert code == 4
    assert "CUDA_VISIBLE_DEVICES is 'GPU-8f1c', expected numbers" in told


def test_a_finished_episode_is_not_driven_again(
    official_executor: Callable[..., Any], tmp_path: Path, process_mark: str
) -> None:
    made, task = official_executor()
    first = made.submit(task("ok")).result(PATIENCE_S)
    again = made.submit(task("ok")).result(PATIENCE_S)
    made.close()
    assert len(list((tmp_path / "runs").glob("*/logs/*.log"))) == 1
    assert (again.outcome, again.route_completion_pct, again.schedule) == (first.outcome, 100.0, first.schedule)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--setting", "fog 3"], "fog 3"),
        (["--routes", "nowhere.xml"], "nowhere.xml"),
        (["--routes", ""], "--routes is empty, expected FILE.xml"),
        (["--routes", "some.xml:,"], "no route ids after 'some.xml'"),
        (["--slots", "0"], "--slots is 0"),
        (["--seed", "-1"], "--seed holds -1, expected whole numbers >= 0"),
        (["--gpu", "-2"], "--gpu is -2, expected 0 or more"),
        (["--route-s", "nan"], "--route-s is nan, expected seconds > 0"),
        (["--route-s", "-5"], "--route-s is -5, expected seconds > 0"),
        (["--silence-s", "0"], "--silence-s is 0, expected seconds > 0"),
        (["--port", "61000"], "the first port is 61000: with the traffic managers', ports up to 67149"),
        (["--port", "99999"], "the first port is 99999"),
        (["--port", "-5"], "the first port is -5"),
        (["--slots", "400"], "ports up to 89399 may be taken (slots: 400), expected 1 to 65535"),
        (["--root", "/nowhere"], "no Bench2Drive checkout"),
        (["--carla-root", "/nowhere"], "no CarlaUE4.sh"),
        (["--agent", "nothing.py"], "no agent file"),
        (["--out", "/proc/x"], "/proc/x: No such file or directory."),
    ],
)
def test_misuse_is_said_and_nothing_is_started(
    arguments: list[str], text: str, official_run: Callable[..., Any], tmp_path: Path
) -> None:
    code, told = official_run("ok", *arguments)
    assert code == 4
    assert text in told
    assert not (tmp_path / "out").exists()


def test_help_states_how_long_is_waited(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert "longest wall time of a route; default: 21600" in told
    assert "longest time in which the evaluator prints nothing; default: 1200" in told


def test_a_result_that_cannot_be_read_is_told_without_its_place_which_is_removed(
    official_executor: Callable[..., Any], tmp_path: Path
) -> None:
    made, task = official_executor(tries=1)
    detail = made.submit(task("half")).result(PATIENCE_S).end_detail
    assert "its result is not valid JSON" in detail
    assert "result.json" not in detail
    (log,) = tmp_path.glob("runs/*/logs/*.log")
    assert f"(see {log})" in detail


def test_more_slots_than_there_are_ports_are_refused(official_executor: Callable[..., Any]) -> None:
    with pytest.raises(UsageError, match=r"ports up to 67999 may be taken \(slots: 400\)"):
        official_executor(slots=400, port=2000)
