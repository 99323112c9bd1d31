"""A guard, its nursery and its children when something other than the agent breaks, or somebody wants to stop."""

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
from guarded_worlds import HERE, gone_within, recipe, task

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.engine.guard import Guard, Stopped
from pytest_drive_robust.engine.limits import Limits
from pytest_drive_robust.engine.nursery import Nursery
from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError

Make = Callable[..., Guard]
LIMITS = Limits(episode_s=20.0, act_s=0.5)


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
def test_a_world_that_ends_its_process_is_our_error(make_guard: Make, simulator: str, detail: str) -> None:
    result = make_guard(LIMITS, simulator).drive(task("Steady"))
    assert (result.outcome, result.end) == (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED)
    assert result.end_detail.startswith(detail)
    assert (result.route_completion_pct, result.infractions) == (0.0, ())


def test_a_world_that_hangs_is_our_error(make_guard: Make) -> None:
    result = make_guard(Limits(episode_s=0.4), "HangsInStep").drive(task("Steady"))
    assert (result.outcome, result.end) == (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED)
    assert "longer than 0.4 s, most of it in the simulation; it was at tick 20" in result.end_detail


def test_a_world_that_raises_is_tried_three_times(make_guard: Make, note: Path) -> None:
    result = make_guard(LIMITS, "RaisesInStep").drive(task("Steady"))
    assert (result.outcome, result.ticks) == (Outcome.INFRA_ERROR, 20)
    assert "lost the server" in result.end_detail
    assert note.read_text() == "xxx"


def test_a_world_that_works_in_the_third_try_is_no_error(make_guard: Make, note: Path) -> None:
    result = make_guard(LIMITS, "DiesTwice").drive(task("Steady"))
    assert result.outcome is Outcome.COMPLETED
    assert note.read_text() == "xxx"


def test_a_nursery_that_was_killed_is_started_again(make_guard: Make) -> None:
    nursery = Nursery(recipe())
    guard = Guard(nursery, LIMITS)
    try:
        first = guard.drive(task("Steady"))
        old, child = nursery.pid, guard.pid
        assert old is not None
        assert child is not None
        os.kill(old, signal.SIGKILL)
        assert gone_within(child, 5.0)
        assert guard.drive(task("Steady")).trace.digest == first.trace.digest
        assert nursery.pid != old
    finally:
        guard.close()
        nursery.close()


@pytest.mark.parametrize(
    ("agent", "error", "detail"),
    [
        ("nobody", UnknownNameError, "there is no agent named 'nobody'"),
        ("guarded_agents:Nobody", UnknownNameError, "no object in guarded_agents"),
        ("guarded_agents:FAULT_TICK", PluginError, "expected a class or a function"),
    ],
)
def test_an_agent_that_cannot_be_made_is_the_users_error(
    make_guard: Make, agent: str, error: type[UsageError], detail: str
) -> None:
    guard = make_guard()
    with pytest.raises(error, match=detail):
        guard.drive(task(agent))
    assert guard.drive(task("Steady")).outcome is Outcome.COMPLETED


def test_a_world_that_cannot_be_made_is_the_users_error(make_guard: Make) -> None:
    with pytest.raises(PluginError, match="the licence of the world"):
        make_guard(LIMITS, "no_world").drive(task("Steady"))


def test_a_module_that_cannot_be_imported_is_the_users_error(make_guard: Make) -> None:
    with pytest.raises(UsageError, match="nowhere_to_be_found"):
        make_guard(LIMITS, "nowhere_to_be_found:World").drive(task("Steady"))


def test_stop_cuts_an_episode_off_and_leaves_nothing(make_guard: Make) -> None:
    guard = make_guard(Limits())
    caught: list[BaseException] = []

    def drive() -> None:
        try:
            guard.drive(task("Hangs"))
        except Stopped as error:
            caught.append(error)

    driving = threading.Thread(target=drive)
    driving.start()
    while guard.ticks < 30:
        time.sleep(0.001)
    pid = guard.pid
    assert pid is not None
    guard.stop()
    guard.stop()
    driving.join(10.0)
    assert len(caught) == 1
    assert gone_within(pid, 5.0)
    with pytest.raises(Stopped):
        guard.drive(task("Steady"))
    guard.close()
    guard.close()
    guard.stop()


def test_a_guard_that_was_stopped_before_it_began_starts_nothing() -> None:
    nursery = Nursery(recipe())
    guard = Guard(nursery, LIMITS)
    guard.stop()
    with pytest.raises(Stopped):
        guard.drive(task("Steady"))
    assert nursery.pid is None
    guard.close()
    nursery.close()


def test_stop_does_not_wait_until_everything_is_loaded(tmp_path: Path) -> None:
    (tmp_path / "slow_plugin.py").write_text("import time\ntime.sleep(600)\n")
    nursery = Nursery(recipe(plugins=(("slow_plugin", str(tmp_path / "slow_plugin.py")),)))
    guard = Guard(nursery, LIMITS)
    caught: list[BaseException] = []

    def drive() -> None:
        try:
            guard.drive(task("Steady"))
        except Stopped as error:
            caught.append(error)

    driving = threading.Thread(target=drive)
    driving.start()
    while nursery.pid is None:
        time.sleep(0.001)
    pid = nursery.pid
    guard.stop()
    driving.join(20.0)
    assert len(caught) == 1
    assert gone_within(pid, 5.0)
    guard.close()
    nursery.close()


def test_a_nursery_that_is_killed_while_it_loads_is_started_again() -> None:
    nursery = Nursery(recipe())
    guard = Guard(nursery, LIMITS)

    def kill_it() -> None:
        while nursery.pid is None:
            time.sleep(0.0005)
        os.kill(nursery.pid, signal.SIGKILL)

    killer = threading.Thread(target=kill_it)
    killer.start()
    try:
        assert guard.drive(task("Steady")).outcome is Outcome.COMPLETED
    finally:
        killer.join()
        guard.close()
        nursery.close()


def test_closing_ends_the_processes(make_guard: Make) -> None:
    nursery = Nursery(recipe())
    guard = Guard(nursery, LIMITS)
    guard.drive(task("Steady"))
    pids = (guard.pid, nursery.pid)
    guard.close()
    nursery.close()
    nursery.close()
    for pid in pids:
        assert pid is not None
        assert gone_within(pid, 5.0)


PARENT = """
import sys
sys.path.insert(0, sys.argv[1])
from guarded_worlds import recipe, task
from pytest_drive_robust.engine.guard import Guard
from pytest_drive_robust.engine.limits import Limits
from pytest_drive_robust.engine.nursery import Nursery
import threading, time

nursery = Nursery(recipe())
guards = [Guard(nursery, Limits()) for _ in range(2)]
agents = ("Hangs", "LeavesADaemonAndHangs")
for guard, agent in zip(guards, agents):
    threading.Thread(target=guard.drive, args=(task(agent),), daemon=True).start()
while min(guard.ticks for guard in guards) < 30:
    time.sleep(0.01)
time.sleep(0.2)
print(nursery.pid, *[guard.pid for guard in guards], flush=True)
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
    deadline = time.monotonic() + 1.0
    assert [pid for pid in pids if not gone_within(pid, max(0.0, deadline - time.monotonic()))] == []


@pytest.mark.parametrize("agent", ["Steady", "Segfaults", "HangsInC"])
def test_where_forking_is_not_safe_each_child_is_a_new_python(make_guard: Make, agent: str) -> None:
    forked = make_guard().drive(task(agent))
    nursery = Nursery(recipe(), fork=False)
    guard = Guard(nursery, LIMITS)
    try:
        result = guard.drive(task(agent))
    finally:
        guard.close()
        nursery.close()
    assert nursery.pid is None
    assert (result.outcome, result.end, result.ticks) == (forked.outcome, forked.end, forked.ticks)
    assert result.end_detail == forked.end_detail
    assert result.trace.digest == forked.trace.digest
