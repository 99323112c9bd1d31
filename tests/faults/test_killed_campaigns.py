"""Whatever is killed: nothing that was finished is lost, and little is driven twice."""

from __future__ import annotations

import sys
import time

import pytest
from killed_campaign import Campaign, descendants

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    campaign = Campaign(tmp_path_factory.mktemp("undisturbed") / "suite")
    campaign.write()
    assert campaign.run("--drive-executor", "inline") == 0, (campaign.folder / "output.txt").read_text()
    assert campaign.begun() == campaign.episodes
    return campaign


SLOWLY_S = 0.002
ENGINES = {"processes": ("--drive-workers", "2"), "workers of xdist": ("-n", "2")}


@pytest.mark.parametrize("engine", ENGINES)
def test_kills_cost_only_what_was_in_flight(tmp_path, undisturbed, engine):
    campaign = Campaign(tmp_path / "suite", tick_s=SLOWLY_S)
    campaign.write()
    campaign.disturb(ENGINES[engine], kills=8, seed=1)
    campaign.run(*ENGINES[engine])
    assert campaign.kills >= 4
    assert campaign.lost == []
    assert campaign.digests() == undisturbed.digests()
    assert campaign.begun() <= campaign.episodes + 2 * campaign.kills  # two in flight


@pytest.mark.slow
@pytest.mark.usefixtures("whole_study")
def test_fifty_kills(tmp_path):
    quiet = Campaign(tmp_path / "quiet", routes=60)
    campaign = Campaign(tmp_path / "killed", routes=60, tick_s=SLOWLY_S)
    quiet.write()
    assert quiet.run("--drive-executor", "inline") == 0
    campaign.write()
    campaign.disturb(ENGINES["processes"], kills=50, seed=2)
    campaign.run(*ENGINES["processes"])
    assert campaign.kills >= 50
    assert campaign.lost == []
    assert campaign.digests() == quiet.digests()
    assert campaign.episodes < campaign.begun() <= campaign.episodes + 2 * campaign.kills


@pytest.mark.parametrize("engine", ENGINES)
def test_a_second_run_drives_nothing(tmp_path, engine):
    campaign = Campaign(tmp_path / "suite", routes=3)
    campaign.write()
    assert campaign.run(*ENGINES[engine]) == 0, (campaign.folder / "output.txt").read_text()
    assert campaign.begun() == campaign.episodes
    assert campaign.run() == 0
    assert campaign.begun() == campaign.episodes


def test_no_process_outlives_a_killed_controller(tmp_path):
    campaign = Campaign(tmp_path / "suite", tick_s=SLOWLY_S)
    campaign.write()
    process = campaign.begin("--drive-workers", "2")
    while campaign.begun() < 4 and process.poll() is None:
        time.sleep(0.02)
    below = descendants(process.pid)
    assert below
    process.kill()
    process.wait()
    deadline = time.monotonic() + 3.0
    while any(_lives(pid) for pid in below) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert [pid for pid in below if _lives(pid)] == []


def _lives(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
