"""One process of a run from which the fork_servers of its workers are forked: who gets one, and what stays behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from guarded_worlds import alive, gone_within, request, worker_setup
from killed_campaign import descendants

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.cradle import Cradle
from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.limits import Limits
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.store.record import encode_episode

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at processes in /proc")

RUN = """
import pytest
from pytest_drive_robust import requirement

@pytest.mark.parametrize("number", range(2))
def test_it(drive, number):
    drive.check(requirement("DS") >= 1, verdict="list")
"""


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return tmp_path / "cradle"


@pytest.fixture
def cradle(place: Path) -> Iterator[Cradle]:
    made = Cradle(worker_setup(), place)
    made.open(at_once=False)
    yield made
    made.close()


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def driven(fork_server: ForkServer) -> tuple[Outcome, int]:
    """How an episode of it ended, and the parent of the fork_server."""
    supervisor = Supervisor(fork_server, Limits())
    try:
        ended = supervisor.drive(request("Steady"))
        assert fork_server.pid is not None
        return ended.outcome, parent_of(fork_server.pid)
    finally:
        supervisor.close()


def test_two_nurseries_have_one_parent_which_is_not_us_and_end_with_their_owners(cradle, place):
    first, second = (ForkServer(replace(worker_setup(), cradle=str(place))) for _ in range(2))
    ended, parent = driven(first)
    assert ended is Outcome.COMPLETED
    assert parent != os.getpid()
    assert driven(second) == (ended, parent)
    pids = (first.pid, second.pid)
    assert len({*pids, parent}) == 3
    first.close()
    assert gone_within(pids[0], 3.0)
    assert alive(pids[1])
    second.close()
    assert gone_within(pids[1], 3.0)
    cradle.close()
    assert gone_within(parent, 3.0)


def test_an_episode_gives_the_same_bits_from_either(cradle, place):
    results = []
    for made in (worker_setup(), replace(worker_setup(), cradle=str(place))):
        fork_server = ForkServer(made)
        supervisor = Supervisor(fork_server, Limits())
        results.append(replace(supervisor.drive(request("Steady")), wall_s=0.0, inference_s=()))
        supervisor.close()
        fork_server.close()
    one, other = map(encode_episode, results)
    assert one == other


def test_the_environment_of_the_worker_is_that_of_its_children(cradle, place, monkeypatch):
    driven(
        first := ForkServer(replace(worker_setup(), cradle=str(place)))
    )  # the cradle runs, and knows nothing of what follows
    first.close()
    monkeypatch.setenv("DRIVE_ROBUST_TEST_NOTE", "of the worker")
    fork_server = ForkServer(replace(worker_setup(), cradle=str(place)))
    supervisor = Supervisor(fork_server, Limits())
    told = supervisor.drive(request("TellsItsSurroundings")).end_detail
    supervisor.close()
    fork_server.close()
    assert "of the worker" in told


@pytest.mark.parametrize("change", ["environment", "threads", "dead", "nobody"])
def test_who_cannot_share_starts_one_of_his_own(cradle, place, monkeypatch, change):
    made = replace(worker_setup(), cradle=str(place))
    if change == "environment":  # numba reads it once
        cradle.close()
        again = Cradle(worker_setup(), place)
        again.open(at_once=True)
        monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    elif change == "threads":
        made = replace(made, threads=2)
    elif change == "dead":
        first = ForkServer(made)
        _, parent = driven(first)
        os.kill(parent, signal.SIGKILL)
        first.close()
    else:
        made = replace(made, cradle=str(place) + "-not")
    fork_server = ForkServer(made)
    assert driven(fork_server) == (Outcome.COMPLETED, os.getpid())
    fork_server.close()
    if change == "environment":
        again.close()


def test_a_worker_that_dies_takes_its_nursery_along(cradle, place):
    code = (
        "import sys, time; sys.path[:0] = sys.argv[2:]; from dataclasses import replace\n"
        "from guarded_worlds import worker_setup\nfrom pytest_drive_robust.engine.limits import Limits\n"
        "from pytest_drive_robust.engine.fork_server import ForkServer\n"
        "fork_server = ForkServer(replace(worker_setup(), cradle=sys.argv[1])); child = fork_server.child(Limits())\n"
        "print(fork_server.pid, child.pid, flush=True); time.sleep(600)"
    )
    command = [sys.executable, "-c", code, str(place), str(Path(__file__).parents[1] / "helpers")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as worker:
        assert worker.stdout is not None
        pids = [int(word) for word in worker.stdout.readline().split()]
        assert len(pids) == 2
        assert all(map(alive, pids))
        worker.kill()
    assert all(gone_within(pid, 3.0) for pid in pids)


def test_nothing_is_started_for_nobody(cradle):
    before = set(descendants(os.getpid()))
    time.sleep(0.2)
    cradle.close()
    assert set(descendants(os.getpid())) == before


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=["killed", "interrupted"])
def test_two_workers_share_it_and_a_controller_that_ends_leaves_nobody(tmp_path, plugin_args, number):
    (tmp_path / "test_run.py").write_text(RUN)
    options = ("--drive-robust", "-n", "2", "--drive-agent", "constant", "--drive-seeds", ",".join(map(str, range(50))))
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *plugin_args, *options, str(tmp_path)]
    with open(tmp_path / "output.txt", "wb") as output:
        process = subprocess.Popen(command, cwd=tmp_path, stdout=output, stderr=output, start_new_session=True)
    try:
        deadline = time.monotonic() + 60.0
        while len(list(tmp_path.glob(".drive-robust/episodes/*/*.episode"))) < 4:
            assert process.poll() is None, (tmp_path / "output.txt").read_text()
            assert time.monotonic() < deadline
            time.sleep(0.02)
        below = descendants(process.pid)
        cradles = [pid for pid in below if b"forking import cradle" in Path(f"/proc/{pid}/cmdline").read_bytes()]
        fork_servers = [
            pid for pid in cradles if parent_of(pid) in cradles and parent_of(parent_of(pid)) not in cradles
        ]
        assert len(fork_servers) == 2
        if number == signal.SIGINT:
            os.killpg(process.pid, number)
        else:
            process.kill()
        process.wait(timeout=60)
        assert all(gone_within(pid, 15.0) for pid in below)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
