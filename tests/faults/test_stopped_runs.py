"""Ctrl-C, killed workers and killed controllers, through the front door: what is finished is kept, nothing stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from guarded_worlds import alive
from killed_campaign import Campaign, descendants

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")

ENGINES = {"pool": ("--drive-workers", "2"), "xdist": ("-n", "2"), "inline": ("--drive-executor", "inline")}
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
        time.sleep(600)


_register = pytest_drive_robust_register


def pytest_drive_robust_register(registry):
    _register(registry)
    registry.register_agent("deaf", Deaf)
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Campaign:
    made = Campaign(tmp_path / "suite", routes=10, tick_s=0.002)
    made.write()
    return made


def wait_for(campaign: Campaign, process: subprocess.Popen[bytes], *, begun: int, stored: int = 0) -> None:
    """Until so many episodes were begun and stored."""
    deadline = time.monotonic() + 60.0
    while campaign.begun() < begun or len(campaign.stored()) < stored:
        assert process.poll() is None, (campaign.folder / "output.txt").read_text()
        assert time.monotonic() < deadline
        time.sleep(0.01)


def left_alive(pids: list[int], *, within_s: float = 3.0) -> list[int]:
    deadline = time.monotonic() + within_s
    while any(map(alive, pids)) and time.monotonic() < deadline:
        time.sleep(0.02)
    return [pid for pid in pids if alive(pid)]


def finish(campaign: Campaign, kept: set[str], *, in_flight: int) -> None:
    """Run again: what was finished is still there and not driven again."""
    assert kept <= campaign.stored()
    begun = campaign.begun()
    campaign.tick_s = 0.0
    assert campaign.run() == 0, (campaign.folder / "output.txt").read_text()
    assert len(campaign.stored()) == campaign.episodes
    assert campaign.begun() - begun == campaign.episodes - len(kept)
    assert begun <= len(kept) + in_flight


@pytest.mark.parametrize("times", [1, 2], ids=["once", "twice"])
@pytest.mark.parametrize("engine", ENGINES)
def test_control_c_ends_soon_and_keeps_what_is_finished(campaign, engine, times):
    process = campaign.begin(*ENGINES[engine])
    wait_for(campaign, process, begun=6, stored=4)
    below = descendants(process.pid)
    for number in range(times):
        if number:
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process of the job
    # Ending its workers takes pytest-xdist up to ten seconds, whatever they do.
    assert process.wait(timeout=60 if engine == "xdist" else 10) == 2, (campaign.folder / "output.txt").read_text()
    assert left_alive(below) == []
    output = (campaign.folder / "output.txt").read_text()
    assert "KeyboardInterrupt" in output
    assert "INTERNALERROR" not in output
    assert "Exception ignored" not in output
    finish(campaign, campaign.stored(), in_flight=2)


def test_control_c_does_not_wait_for_an_agent_that_hears_nothing(campaign):
    conftest = campaign.folder / "conftest.py"
    conftest.write_text(conftest.read_text() + DEAF)
    process = campaign.begin("--drive-workers", "2", "--drive-agent", "deaf")
    wait_for(campaign, process, begun=2)
    below = descendants(process.pid)
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=20) == 2
    assert left_alive(below) == []
    assert campaign.stored() == set()  # what ended because we stopped is no result


def test_a_killed_worker_of_xdist_costs_its_test_and_what_it_drove(campaign):
    process = campaign.begin(*ENGINES["xdist"])
    wait_for(campaign, process, begun=5, stored=3)
    workers = [pid for pid in descendants(process.pid) if parent_of(pid) == process.pid]
    victim = workers[0]
    below = descendants(victim)
    kept = campaign.stored()
    os.kill(victim, signal.SIGKILL)
    assert process.wait(timeout=60) in (0, 1)  # 1: it was within a test, which xdist reports as failed
    assert left_alive(below) == []
    output = (campaign.folder / "output.txt").read_text()
    assert "INTERNALERROR" not in output
    assert kept <= campaign.stored()
    campaign.tick_s = 0.0
    assert campaign.run() == 0
    assert len(campaign.stored()) == campaign.episodes
    assert campaign.begun() <= campaign.episodes + 1


@pytest.mark.parametrize("engine", ["pool", "xdist"])
def test_a_killed_controller_leaves_no_process_and_the_next_run_goes_on(campaign, engine):
    process = campaign.begin(*ENGINES[engine])
    wait_for(campaign, process, begun=5, stored=3)
    below = descendants(process.pid)
    assert below
    process.kill()
    process.wait()
    # A worker of xdist hears of it when its test is over; its children end with it.
    assert left_alive(below, within_s=3.0 if engine == "pool" else 15.0) == []
    kept = campaign.stored()
    begun = campaign.begun()
    assert begun <= len(kept) + 2
    campaign.tick_s = 0.0
    assert campaign.run(*ENGINES[engine]) == 0
    assert campaign.begun() - begun == campaign.episodes - len(kept)


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
