"""Whatever is killed: nothing that was finished is lost, and little is driven twice."""

from __future__ import annotations

import sys

import pytest
from killed_campaign import Campaign

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
EPISODES_PER_KILL = {"processes": 2, "workers of xdist": 3}
"""How many at most are begun again: the two in flight. Under xdist one kill costs what that worker drove; and once in a
run that lost a test, the two workers that live at its end may be at episodes that nobody else asks for."""


@pytest.mark.parametrize("engine", ENGINES)
def test_kills_cost_only_what_was_in_flight(tmp_path, undisturbed, engine):
    campaign = Campaign(tmp_path / "suite", tick_s=SLOWLY_S, hold=24)
    campaign.write()
    campaign.disturb(ENGINES[engine], kills=8, seed=1)
    campaign.run(*ENGINES[engine])
    assert campaign.kills >= 4
    assert campaign.lost == []
    assert campaign.digests() == undisturbed.digests()
    assert campaign.begun() <= campaign.episodes + EPISODES_PER_KILL[engine] * campaign.kills


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
