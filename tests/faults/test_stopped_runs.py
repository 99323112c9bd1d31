"""Ctrl-C, killed workers and killed controllers, through the front door: what is finished is kept, nothing stays.

Every run is stopped while each of its slots is at the beginning of an episode and waits there: no clock decides what
had happened by then.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from guarded_worlds import gone_within
from killed_campaign import Campaign, descendants
from patience import PATIENCE_S

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")

ENGINES = {"pool": ("--drive-workers", "2"), "xdist": ("-n", "2"), "inline": ("--drive-executor", "inline")}
SLOTS = {"pool": 2, "xdist": 2, "inline": 1}
STORED = 4
DEAF = """

class Deaf:
    def sensors(self):
        return ()

    def reset(self, route, seed):
        pass

    def act(self, observation):
        import signal
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        (GO.parent / f"deaf-{os.getpid()}").touch()
        time.sleep(600)


_register = pytest_drive_robust_register


def pytest_drive_robust_register(registry):
    _register(registry)
    registry.register_agent("deaf", Deaf)
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Campaign:
    made = Campaign(tmp_path / "suite", routes=10, hold=STORED + 1)
    made.write()
    return made


def wait_until(happened: Callable[[], bool], campaign: Campaign, process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not happened():
        assert process.poll() is None, (campaign.folder / "output.txt").read_text()
        assert time.monotonic() < deadline
        time.sleep(0.01)


def begin_and_hold(campaign: Campaign, engine: str, **environment: str) -> subprocess.Popen[bytes]:
    """Start a run and return it when all of its slots wait in an episode, and what was driven before is stored."""
    process = campaign.begin(*ENGINES[engine], **environment)
    in_flight = STORED + SLOTS[engine]
    wait_until(lambda: (campaign.begun(), len(campaign.stored())) == (in_flight, STORED), campaign, process)
    return process


def left_alive(pids: list[int]) -> list[int]:
    return [pid for pid in pids if not gone_within(pid, PATIENCE_S)]


@pytest.mark.parametrize("times", [1, 2], ids=["once", "twice"])
@pytest.mark.parametrize("engine", ENGINES)
def test_control_c_ends_and_keeps_what_is_finished(campaign, engine, times):
    process = begin_and_hold(campaign, engine, **({"CAMPAIGN_SECOND": "waits"} if times == 2 else {}))
    below = descendants(process.pid)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process of the job
    if times == 2:  # when each process that runs tests has heard the first one and is ending
        hearing = 3 if engine == "xdist" else 1
        wait_until(lambda: len(campaign.noted("interrupted")) == hearing, campaign, process)
        os.killpg(process.pid, signal.SIGINT)
        (campaign.folder / "second").touch()
    assert process.wait(timeout=PATIENCE_S) == 2, (campaign.folder / "output.txt").read_text()
    assert left_alive(below) == []
    output = (campaign.folder / "output.txt").read_text()
    assert "KeyboardInterrupt" in output
    assert "INTERNALERROR" not in output
    assert "Exception ignored" not in output
    assert (campaign.begun(), len(campaign.stored())) == (STORED + SLOTS[engine], STORED)
    campaign.go()
    assert campaign.run() == 0, (campaign.folder / "output.txt").read_text()
    assert len(campaign.stored()) == campaign.episodes
    assert campaign.begun() == campaign.episodes + SLOTS[engine], "what was finished is not driven again"


def test_control_c_does_not_wait_for_an_agent_that_hears_nothing(campaign):
    campaign.hold = 0
    conftest = campaign.folder / "conftest.py"
    conftest.write_text(conftest.read_text() + DEAF)
    process = campaign.begin("--drive-workers", "2", "--drive-agent", "deaf")
    wait_until(lambda: len(list(campaign.folder.glob("deaf-*"))) == 2, campaign, process)
    below = descendants(process.pid)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=PATIENCE_S) == 2  # the agents sleep twice as long
    assert left_alive(below) == []
    assert campaign.stored() == set()  # what ended because we stopped is no result


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL], ids=["terminated", "killed"])
def test_a_controller_that_ends_takes_an_agent_along_that_hears_nothing(campaign, number):
    campaign.hold = 0
    conftest = campaign.folder / "conftest.py"
    conftest.write_text(conftest.read_text() + DEAF)
    process = campaign.begin("-n", "2", "--drive-agent", "deaf", "--drive-act-timeout", "10m")
    wait_until(lambda: len(list(campaign.folder.glob("deaf-*"))) == 2, campaign, process)
    below = descendants(process.pid)
    process.send_signal(number)
    process.wait(timeout=PATIENCE_S)
    assert left_alive(below) == []  # the agents sleep twice as long


@pytest.mark.parametrize(("victim", "cut_off"), [("clean", 0), ("throttle", 2)])
def test_a_killed_worker_of_xdist_costs_its_test_and_what_it_drove(campaign, victim, cut_off):
    """Its test is not run again. Every clean episode is asked for by other tests, too, and the run drives them all.

    Episodes that only the lost test would have asked for are planned: the worker that lives and the one that takes
    over drive some of them ahead, and each may be at one, which is cut off, when the last test is over (`cut_off`).
    """
    process = begin_and_hold(campaign, "xdist")
    (pid,) = {int(pid) for pid, test in campaign.noted("tests") if victim in test and int(pid) != process.pid}
    below = descendants(pid)
    os.kill(pid, signal.SIGKILL)
    assert left_alive([pid, *below]) == []
    campaign.go()
    assert process.wait(timeout=PATIENCE_S) == 1  # xdist reports its test as failed
    output = (campaign.folder / "output.txt").read_text()
    assert "INTERNALERROR" not in output
    begun, stored = campaign.begun(), len(campaign.stored())
    assert 1 <= begun - stored <= 1 + cut_off
    assert stored == campaign.episodes or cut_off
    assert campaign.run() == 0
    assert len(campaign.stored()) == campaign.episodes
    assert campaign.begun() - begun == campaign.episodes - stored, "what was finished is not driven again"


@pytest.mark.parametrize("engine", ["pool", "xdist"])
def test_a_killed_controller_leaves_no_process_and_the_next_run_goes_on(campaign, engine):
    process = begin_and_hold(campaign, engine)
    below = descendants(process.pid)
    assert below
    process.kill()
    process.wait()
    if engine == "xdist":  # a worker of xdist hears of it when its test is over; its children end with it
        campaign.go()
    assert left_alive(below) == []
    begun, stored = campaign.begun(), len(campaign.stored())
    assert begun - stored <= SLOTS[engine]
    assert stored == STORED or engine == "xdist"
    campaign.go()
    assert campaign.run(*ENGINES[engine]) == 0
    assert campaign.begun() - begun == campaign.episodes - stored
