"""Stores that are shared, full, read-only or damaged, and clocks that jump, through the front door."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest
from killed_campaign import Campaign
from patience import PATIENCE_S

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="forks and reads /proc")

PROCESSES = ("--drive-workers", "2")
WORKERS = ("-n", "2")
DISK = """
import errno

STORE = str(Path(__file__).parent / ".drive-robust")
_open, _mkdir, _write = os.open, os.mkdir, os.write


def full(descriptor, data):
    if STORE in os.readlink(f"/proc/self/fd/{descriptor}"):
        if len(data) > 100:
            _write(descriptor, data[:100])  # there was room for this much
        raise OSError(errno.ENOSPC, "No space left on device")
    return _write(descriptor, data)


def read_only_open(path, flags, *arguments, **options):
    if STORE in os.path.abspath(path) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
        raise OSError(errno.EROFS, "Read-only file system")
    return _open(path, flags, *arguments, **options)


def read_only_mkdir(path, *arguments, **options):
    if STORE in os.path.abspath(path) and not os.path.isdir(path):
        raise OSError(errno.EROFS, "Read-only file system")
    return _mkdir(path, *arguments, **options)


"""
FULL = "os.write = full\n"
READ_ONLY = "os.open, os.mkdir = read_only_open, read_only_mkdir\n"
CLOCK = """
import itertools

_jumps = itertools.cycle([0.0, 1e9, -1e9, 3e8, -86400.0])
_time, _time_ns = time.time, time.time_ns
time.time = lambda: _time() + next(_jumps)
time.time_ns = lambda: _time_ns() + int(next(_jumps)) * 10**9
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Campaign:
    made = Campaign(tmp_path / "suite", routes=3)
    made.write()
    return made


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    made = Campaign(tmp_path_factory.mktemp("quiet") / "suite", routes=3)
    made.write()
    assert made.run("--drive-executor", "inline") == 0
    return made


def output_of(campaign: Campaign) -> str:
    return " ".join((campaign.folder / "output.txt").read_text().split())


def each_once(campaign: Campaign) -> bool:
    """Every route was begun four times, under four settings."""
    counts = Counter((campaign.folder / "begun.log").read_text().splitlines())
    return set(counts.values()) == {4} and len(counts) == campaign.routes


@pytest.mark.parametrize("other", [PROCESSES, WORKERS], ids=["pool", "xdist"])
def test_two_runs_at_once_drive_each_episode_once(tmp_path, other):
    campaign = Campaign(tmp_path / "suite", routes=8, tick_s=0.002)
    campaign.write()
    runs = [campaign.begin(*PROCESSES), campaign.begin(*other)]
    assert [run.wait(timeout=PATIENCE_S) for run in runs] == [0, 0], output_of(campaign)
    assert len(campaign.stored()) == campaign.begun() == campaign.episodes
    assert each_once(campaign)


@pytest.mark.parametrize("engine", [PROCESSES, WORKERS], ids=["pool", "xdist"])
@pytest.mark.parametrize(("fault", "said"), [(FULL, "No space left"), (READ_ONLY, "Read-only file system")])
def test_a_store_that_takes_nothing_costs_no_verdict_and_no_second_drive(campaign, engine, fault, said):
    conftest = campaign.folder / "conftest.py"
    before = conftest.read_text()
    conftest.write_text(before + DISK + fault)
    assert campaign.run(*engine) == 0, output_of(campaign)
    assert each_once(campaign)
    assert output_of(campaign).count("cannot be written to") == 1
    assert said in output_of(campaign)
    assert campaign.stored() == set()
    assert not list(campaign.folder.glob(".drive-robust/**/*.tmp"))
    conftest.write_text(before)  # there is room again
    assert campaign.run("--drive-executor", "inline") == 0
    assert len(campaign.stored()) == campaign.episodes


def test_a_full_store_gives_what_it_holds(campaign):
    assert campaign.run(*PROCESSES, "-k", "clean") == 0
    held = campaign.stored()
    # Not in conftest.py, whose every byte is in the key of an agent that is written there.
    (campaign.folder / "full_disk.py").write_text("import os\nfrom pathlib import Path\n" + DISK + FULL)
    assert campaign.run(*PROCESSES, "-p", "full_disk") == 0, output_of(campaign)
    assert campaign.stored() == held
    assert each_once(campaign)


def test_every_kind_of_damage_is_driven_again_once_and_told(campaign, quiet):
    assert campaign.run(*PROCESSES) == 0
    records = sorted((campaign.folder / ".drive-robust").glob("episodes/*/*.episode"))
    whole = [path.read_bytes() for path in records]
    flipped = bytearray(whole[2])
    flipped[len(flipped) // 2] ^= 1
    damaged = [b"", whole[1][:-1], bytes(flipped), b"\xff" * 1000, whole[0], whole[5] + b"x", b"{}"]
    for path, content in zip(records, damaged, strict=False):
        path.write_bytes(content)
    begun = campaign.begun()
    assert campaign.run(*PROCESSES) == 0
    assert campaign.begun() - begun == len(damaged)
    told = output_of(campaign).replace(" ", "")
    assert all(f"{path.name}isdamaged" in told for path in records[: len(damaged)])
    assert len(list((campaign.folder / ".drive-robust" / "aside").iterdir())) == len(damaged)
    assert campaign.digests() == quiet.digests()
    assert campaign.run(*PROCESSES) == 0
    assert campaign.begun() - begun == len(damaged)


def test_no_single_byte_of_a_record_can_change_unseen(tmp_path):
    campaign = Campaign(tmp_path / "suite", routes=60)
    campaign.write()
    only_clean = ("--drive-executor", "inline", "-k", "clean")
    assert campaign.run(*only_clean) == 0
    records = sorted((campaign.folder / ".drive-robust").glob("episodes/*/*.episode"))
    assert len(records) == campaign.begun() == campaign.routes
    for number, path in enumerate(records):  # one byte each, from the first to the last
        changed = bytearray(path.read_bytes())
        changed[number * (len(changed) - 1) // (len(records) - 1)] ^= 1 << number % 8
        path.write_bytes(bytes(changed))
    assert campaign.run(*only_clean) == 0
    assert campaign.begun() == 2 * campaign.routes


@pytest.mark.parametrize("engine", [PROCESSES, WORKERS], ids=["pool", "xdist"])
def test_a_clock_that_jumps_changes_nothing(campaign, quiet, engine):
    conftest = campaign.folder / "conftest.py"
    conftest.write_text(conftest.read_text() + CLOCK)
    limits = ("--drive-episode-timeout", "60s", "--drive-act-timeout", "30s")
    assert campaign.run(*engine, *limits) == 0, output_of(campaign)
    assert each_once(campaign)
    assert sorted(map(repr, campaign.digests().values())) == sorted(map(repr, quiet.digests().values()))
    assert campaign.run(*engine, *limits) == 0
    assert campaign.begun() == campaign.episodes
