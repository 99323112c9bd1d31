"""What breaks in the harness is tried again, never scored, and never left behind (here: a stand-in for Bench2Drive)."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fake_bench2drive import MARK, left_behind, make
from heeding_interrupts import heed_interrupts
from patience import PATIENCE_S

from pytest_drive_robust.bench2drive.evaluator.attempt import Patience
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.fork_server import Stopped
from pytest_drive_robust.perturbations import GpsNoise, Setting

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="CARLA's evaluator is watched through /proc")


def test_what_the_harness_does_wrong_is_tried_again_and_never_scored(
    official_executor: Callable[..., Any], process_mark: str
) -> None:
    made, task = official_executor(slots=4, patience=Patience(server_s=0.5))
    reasons = {
        "server-dies": "the CARLA server died",
        "crash": "Failed - Simulation crashed",
        "lost": "after the CARLA server was lost",
        "half": "exit code 255",
        "full": "Failed - Agent crashed, for want of memory, room on a disk, files or threads (No space",
    }
    futures = {mode: made.submit(task(mode)) for mode in reasons}
    for mode, future in futures.items():
        result = future.result(PATIENCE_S)
        assert (result.outcome, result.end) == (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED)
        assert result.end_detail.count(reasons[mode]) == 2, result.end_detail
    assert left_behind(process_mark) == []


def test_an_evaluator_that_hangs_is_killed_with_its_server(
    official_executor: Callable[..., Any], process_mark: str
) -> None:
    made, task = official_executor(patience=Patience(silence_s=1.0))
    result = made.submit(task("hang")).result(PATIENCE_S)
    assert result.outcome is Outcome.INFRA_ERROR
    assert result.end_detail.count("said nothing for 1 s") == 2
    assert left_behind(process_mark) == []


def test_a_server_and_evaluator_that_died_are_started_again(
    official_executor: Callable[..., Any], tmp_path: Path, process_mark: str
) -> None:
    made, task = official_executor()
    result = made.submit(task("segfault-once", Setting.of(GpsNoise(5)), seed=3)).result(PATIENCE_S)
    made.close()
    assert result.outcome is Outcome.COMPLETED
    assert result.episode.seed == 3
    assert [(item.perturbation, item.first_tick, item.last_tick) for item in result.schedule] == [("gps-noise", 0, 29)]
    assert result.versions == {"bench2drive": "0.0.3", "carla": "0.9.15"}


def test_daemons_of_an_agent_do_not_outlive_its_route(
    official_executor: Callable[..., Any], tmp_path: Path, process_mark: str
) -> None:
    made, task = official_executor()
    assert made.submit(task("orphans")).result(PATIENCE_S).outcome is Outcome.COMPLETED
    assert left_behind(process_mark) == []


def test_closing_kills_what_is_under_way(
    official_executor: Callable[..., Any], tmp_path: Path, process_mark: str
) -> None:
    made, task = official_executor(slots=2)
    futures = [made.submit(task("hang", route=number)) for number in range(3)]
    _wait_for(lambda: sum("CarlaUE4" in line for line in left_behind(process_mark)) >= 2)
    made.close()
    assert left_behind(process_mark) == []
    assert [future.cancelled() or type(future.exception()) is Stopped for future in futures] == [True] * 3
    made.close()


def test_servers_of_two_commands_have_ports_of_their_own_before_they_listen(
    official_executor: Callable[..., Any], tmp_path: Path, process_mark: str
) -> None:
    for route in (0, 1):
        made, task = official_executor()
        made.submit(task("hang", route=route))
    _wait_for(lambda: sum("server" in log.read_text() for log in tmp_path.glob("runs/*/logs/*.log")) == 2)
    for flag in ("-carla-rpc-port", "--traffic-manager-port"):
        ports = {int(number) for line in left_behind(process_mark) for number in re.findall(rf"{flag}=(\d+)", line)}
        assert len(ports) == 2
        assert max(ports) - min(ports) >= 3  # CARLA takes the next two as well


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_nothing_is_left_when_the_runner_itself_is_killed(number: int, tmp_path: Path, process_mark: str) -> None:
    root, carla, agent = make(tmp_path)
    command = [sys.executable, "-m", "pytest_drive_robust.bench2drive.evaluator", "run", "--root", str(root)]
    command += [
        "--carla-root",
        str(carla),
        "--agent",
        f"{agent}+hang",
        "--out",
        str(tmp_path / "out"),
        "--port",
        "25400",
    ]
    runner = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=heed_interrupts)
    _wait_for(lambda: any("sleep 600" in line for line in left_behind(process_mark)))
    runner.send_signal(number)
    runner.wait(PATIENCE_S)
    _wait_for(lambda: not left_behind(process_mark))
    assert runner.returncode == (130 if number == signal.SIGINT else -number)


def test_nothing_is_left_when_the_guard_is_killed(
    official_executor: Callable[..., Any], tmp_path: Path, process_mark: str
) -> None:
    made, task = official_executor(tries=1)
    future = made.submit(task("hang"))
    _wait_for(lambda: any("sleep 600" in line for line in left_behind(process_mark)))
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != os.getpid():
            try:
                parts = (entry / "cmdline").read_bytes().split(b"\0")
                own = f"{MARK}={process_mark}".encode() in (entry / "environ").read_bytes()
            except OSError:
                continue
            if own and any(part.endswith(b"guard.py") for part in parts):
                os.kill(int(entry.name), signal.SIGKILL)
    assert future.result(PATIENCE_S).outcome is Outcome.INFRA_ERROR
    assert left_behind(process_mark) == []


def _wait_for(condition: Callable[[], bool]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until_s
        threading.Event().wait(0.05)
