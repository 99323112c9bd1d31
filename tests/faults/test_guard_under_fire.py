"""A supervisor, the fork server and its workers when something other than the agent breaks, or somebody stops."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from guarded_worlds import HERE, gone_within, request, worker_setup
from patience import PATIENCE_S

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.fork_server import ForkServer, NoWorkerError
from pytest_drive_robust.engine.supervisor import Stopped, Supervisor
from pytest_drive_robust.engine.worker_setup import Limits
from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError

Make = Callable[..., Supervisor]
LIMITS = Limits(episode_s=300.0, act_s=2.0)


@pytest.fixture
def note(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Where worlds count what happened to them."""
    path = tmp_path / "note"
    monkeypatch.setenv("DRIVE_ROBUST_TEST_NOTE", str(path))
    return path


@pytest.mark.parametrize(
    ("simulator", "detail"),
    [
        ("DiesInStep", "the simulation ended its process: left the process with exit code 9 at tick 20"),
        ("LeavesInPlan", "the simulation raised SystemExit: 9"),
    ],
)
def test_a_world_that_ends_its_process_is_our_error(make_supervisor: Make, simulator: str, detail: str) -> None:
    result = make_supervisor(LIMITS, simulator).drive(request("Steady"))
    assert (result.outcome, result.end) == (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED)
    assert result.end_detail.startswith(detail)
    assert (result.route_completion_pct, result.infractions) == (0.0, ())


def test_a_world_that_hangs_is_our_error(make_supervisor: Make) -> None:
    result = make_supervisor(Limits(episode_s=2.0), "HangsInStep").drive(request("Steady"))
    assert (result.outcome, result.end) == (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED)
    assert "longer than 2 s, most of it in the simulation; it was at tick 20" in result.end_detail


def test_a_world_that_raises_is_tried_three_times(make_supervisor: Make, note: Path) -> None:
    result = make_supervisor(LIMITS, "RaisesInStep").drive(request("Steady"))
    assert (result.outcome, result.ticks) == (Outcome.INFRA_ERROR, 20)
    assert "lost the server" in result.end_detail
    assert note.read_text() == "xxx"


def test_a_world_that_works_in_the_third_try_is_no_error(make_supervisor: Make, note: Path) -> None:
    result = make_supervisor(LIMITS, "DiesTwice").drive(request("Steady"))
    assert result.outcome is Outcome.COMPLETED
    assert note.read_text() == "xxx"


def test_a_fork_server_that_was_killed_is_started_again(make_supervisor: Make) -> None:
    fork_server = ForkServer(worker_setup())
    supervisor = Supervisor(fork_server, LIMITS)
    try:
        first = supervisor.drive(request("Steady"))
        old, child = fork_server.pid, supervisor.pid
        assert old is not None
        assert child is not None
        os.kill(old, signal.SIGKILL)
        assert gone_within(child)
        assert supervisor.drive(request("Steady")).trace.digest == first.trace.digest
        assert fork_server.pid != old
    finally:
        supervisor.close()
        fork_server.close()


@pytest.mark.parametrize(
    ("agent", "error", "detail"),
    [
        ("nobody", UnknownNameError, "there is no agent named 'nobody'"),
        ("guarded_agents:Nobody", UnknownNameError, "no object in guarded_agents"),
        ("guarded_agents:FAULT_TICK", PluginError, "expected a class or a function"),
    ],
)
def test_an_agent_that_cannot_be_made_is_the_users_error(
    make_supervisor: Make, agent: str, error: type[UsageError], detail: str
) -> None:
    supervisor = make_supervisor()
    with pytest.raises(error, match=detail):
        supervisor.drive(request(agent))
    assert supervisor.drive(request("Steady")).outcome is Outcome.COMPLETED


def test_a_world_that_cannot_be_made_is_the_users_error(make_supervisor: Make) -> None:
    with pytest.raises(PluginError, match="the licence of the world"):
        make_supervisor(LIMITS, "no_world").drive(request("Steady"))


def test_a_module_that_cannot_be_imported_is_the_users_error(make_supervisor: Make) -> None:
    with pytest.raises(UsageError, match="nowhere_to_be_found"):
        make_supervisor(LIMITS, "nowhere_to_be_found:World").drive(request("Steady"))


def test_stop_cuts_an_episode_off_and_leaves_nothing(make_supervisor: Make) -> None:
    supervisor = make_supervisor(Limits())
    caught: list[BaseException] = []

    def drive() -> None:
        try:
            supervisor.drive(request("Hangs"))
        except Stopped as error:
            caught.append(error)

    driving = threading.Thread(target=drive)
    driving.start()
    while supervisor.ticks < 30:
        time.sleep(0.001)
    pid = supervisor.pid
    assert pid is not None
    supervisor.stop()
    supervisor.stop()
    driving.join(PATIENCE_S)
    assert len(caught) == 1
    assert gone_within(pid)
    with pytest.raises(Stopped):
        supervisor.drive(request("Steady"))
    supervisor.close()
    supervisor.close()
    supervisor.stop()


def test_a_supervisor_that_was_stopped_before_it_began_starts_nothing() -> None:
    fork_server = ForkServer(worker_setup())
    supervisor = Supervisor(fork_server, LIMITS)
    supervisor.stop()
    with pytest.raises(Stopped):
        supervisor.drive(request("Steady"))
    assert fork_server.pid is None
    supervisor.close()
    fork_server.close()


def test_stop_does_not_wait_until_everything_is_loaded(tmp_path: Path) -> None:
    (tmp_path / "slow_plugin.py").write_text("import time\ntime.sleep(600)\n")
    fork_server = ForkServer(worker_setup(plugins=(("slow_plugin", str(tmp_path / "slow_plugin.py")),)))
    supervisor = Supervisor(fork_server, LIMITS)
    caught: list[BaseException] = []

    def drive() -> None:
        try:
            supervisor.drive(request("Steady"))
        except Stopped as error:
            caught.append(error)

    driving = threading.Thread(target=drive)
    driving.start()
    while fork_server.pid is None:
        time.sleep(0.001)
    pid = fork_server.pid
    supervisor.stop()
    driving.join(PATIENCE_S)
    assert len(caught) == 1
    assert gone_within(pid)
    supervisor.close()
    fork_server.close()


def test_a_fork_server_that_is_killed_while_it_loads_is_started_again() -> None:
    fork_server = ForkServer(worker_setup())
    supervisor = Supervisor(fork_server, LIMITS)

    def kill_it() -> None:
        while fork_server.pid is None:
            time.sleep(0.0005)
        os.kill(fork_server.pid, signal.SIGKILL)

    killer = threading.Thread(target=kill_it)
    killer.start()
    try:
        assert supervisor.drive(request("Steady")).outcome is Outcome.COMPLETED
    finally:
        killer.join()
        supervisor.close()
        fork_server.close()


@pytest.mark.parametrize(
    ("plugin", "ready_s", "told"),
    [
        (
            "import gc, sys, time, traceback\n"
            "def collect(): raise RuntimeError('no home')\n"
            "def tell(*error): time.sleep(0.5); traceback.print_exception(*error)\n"
            "gc.collect, sys.excepthook = collect, tell\n",
            PATIENCE_S,
            "died while it was getting ready. Its last line: RuntimeError: no home",
        ),
        ("print('waits')\nimport time\ntime.sleep(600)\n", 0.5, "was not ready within 0.5 s."),
    ],
    ids=["dies", "hangs"],
)
def test_why_a_fork_server_is_not_ready_is_told(
    plugin: str, ready_s: float, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pytest_drive_robust.engine.fork_server._READY_S", ready_s)
    monkeypatch.setattr("pytest_drive_robust.engine.fork_server._TRIES", 1)
    (tmp_path / "odd_plugin.py").write_text(plugin)
    fork_server = ForkServer(worker_setup(plugins=(("odd_plugin", str(tmp_path / "odd_plugin.py")),)))
    with pytest.raises(NoWorkerError) as caught:
        fork_server.start_worker(LIMITS, "steady", lambda: False)
    assert told in str(caught.value)
    fork_server.close()


def test_closing_ends_the_processes(make_supervisor: Make) -> None:
    fork_server = ForkServer(worker_setup())
    supervisor = Supervisor(fork_server, LIMITS)
    supervisor.drive(request("Steady"))
    pids = (supervisor.pid, fork_server.pid)
    supervisor.close()
    fork_server.close()
    fork_server.close()
    for pid in pids:
        assert pid is not None
        assert gone_within(pid)


PARENT = """
import os
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from guarded_worlds import worker_setup, request
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.engine.worker_setup import Limits
from pytest_drive_robust.engine.fork_server import ForkServer
import threading, time

fork_server = ForkServer(worker_setup())
supervisors = [Supervisor(fork_server, Limits()) for _ in range(2)]
agents = ("Hangs", "LeavesADaemonAndHangs")
for supervisor, agent in zip(supervisors, agents):
    threading.Thread(target=supervisor.drive, args=(request(agent),), daemon=True).start()
note = Path(os.environ["DRIVE_ROBUST_TEST_NOTE"])
while min(supervisor.ticks for supervisor in supervisors) < 30 or not (note.exists() and note.read_text()):
    time.sleep(0.01)
print(fork_server.pid, *[supervisor.pid for supervisor in supervisors], flush=True)
time.sleep(600)
"""


def test_nothing_outlives_a_parent_that_is_killed(note: Path) -> None:
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(HERE)], stdout=subprocess.PIPE, text=True)
    with parent:
        assert parent.stdout is not None
        pids = [int(pid) for pid in parent.stdout.readline().split()]
        assert len(pids) == 3
        parent.kill()
    pids.append(int(note.read_text()))
    assert [pid for pid in pids if not gone_within(pid)] == []


LOADING_PARENT = """
import os
import sys
sys.path.insert(0, sys.argv[1])
from guarded_worlds import worker_setup
from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.worker_setup import Limits

fork_server = ForkServer(worker_setup(plugins=(("hanging_plugin", sys.argv[2]),)))
fork_server.start_worker(Limits(), "steady", lambda: False)
"""


def test_a_fork_server_that_hangs_while_it_loads_ends_with_its_parent(note: Path, tmp_path: Path) -> None:
    plugin = tmp_path / "hanging_plugin.py"
    plugin.write_text(
        "import os, time\n"
        "with open(os.environ['DRIVE_ROBUST_TEST_NOTE'], 'w') as note: note.write(str(os.getpid()))\n"
        f"time.sleep({2 * PATIENCE_S})\n"
    )
    with subprocess.Popen([sys.executable, "-c", LOADING_PARENT, str(HERE), str(plugin)]) as parent:
        while not (note.exists() and note.read_text()):
            time.sleep(0.01)
        parent.kill()
    assert gone_within(int(note.read_text()), 60.0)


@pytest.fixture
def threads(tmp_path: Path) -> tuple[tuple[str, str], ...]:
    """A plugin that starts threads, so that forking is not safe."""
    path = tmp_path / "threads.py"
    path.write_text(
        "import threading, time\n"
        "for _ in range(3):\n"
        "    threading.Thread(target=time.sleep, args=(600,), daemon=True).start()\n"
    )
    return (("threads", str(path)),)


@pytest.mark.parametrize("agent", ["Steady", "Segfaults", "HangsInC"])
def test_where_forking_is_not_safe_each_worker_is_a_new_python(
    make_supervisor: Make, threads: tuple[tuple[str, str], ...], agent: str
) -> None:
    forked = make_supervisor().drive(request(agent))
    fork_server = ForkServer(worker_setup(plugins=threads))
    supervisor = Supervisor(fork_server, LIMITS)
    try:
        supervisor.drive(request("Steady"))
        assert b"serve_in_new_python" in Path(f"/proc/{supervisor.pid}/cmdline").read_bytes()
        result = supervisor.drive(request(agent))
    finally:
        supervisor.close()
        fork_server.close()
    assert (result.outcome, result.end, result.ticks) == (forked.outcome, forked.end, forked.ticks)
    assert result.end_detail == forked.end_detail
    assert result.trace.digest == forked.trace.digest


@pytest.mark.parametrize("fork", [True, False])
def test_setups_side_by_side_have_each_their_own_environment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, threads: tuple[tuple[str, str], ...], fork: bool
) -> None:
    told = []
    for number in range(2):
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.setenv("DRIVE_ROBUST_TEST_NOTE", f"note {number}")
        plugins = () if fork else threads
        fork_server = ForkServer(worker_setup(folder=str(folder), threads=number + 1, plugins=plugins))
        told.append((fork_server, Supervisor(fork_server, LIMITS)))
    for number, (_, supervisor) in enumerate(told):
        monkeypatch.setenv("DRIVE_ROBUST_TEST_NOTE", f"note {number}")
        detail = supervisor.drive(request("TellsItsSurroundings")).end_detail
        assert f"note {number}" in detail
        assert str(tmp_path / str(number)) in detail
        assert f'"OMP_NUM_THREADS": "{number + 1}"' in detail
    for fork_server, supervisor in told:
        supervisor.close()
        fork_server.close()
