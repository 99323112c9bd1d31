"""What an agent does to its process beyond its own memory never reaches the next episode."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from guarded_worlds import alive, gone_within, task

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.guard import Guard
from pytest_drive_robust.engine.limits import Limits
from pytest_drive_robust.engine.nursery import Nursery


@pytest.fixture
def noted_pid(nursery: Nursery, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[], int]:
    """The process that an agent left and told of."""
    nursery.close()  # the next one has the environment of this test
    note = tmp_path / "note"
    monkeypatch.setenv("DRIVE_ROBUST_TEST_NOTE", str(note))
    return lambda: int(note.read_text())


def surroundings(guard: Guard) -> object:
    detail = guard.drive(task("TellsItsSurroundings")).end_detail
    return json.loads(detail.partition("RuntimeError: ")[2].rpartition(" (")[0])


def test_everything_that_can_be_put_back_is_put_back(guard: Guard) -> None:
    before = surroundings(guard)
    pid = guard.pid
    assert guard.drive(task("MeddlesWithEverything")).outcome is Outcome.COMPLETED
    assert surroundings(guard) == before
    assert guard.pid == pid


def test_a_folder_that_is_gone_does_no_harm(guard: Guard) -> None:
    before = surroundings(guard)
    assert guard.drive(task("MovesIntoAFolderThatGoesAway")).outcome is Outcome.COMPLETED
    assert surroundings(guard) == before


def test_the_global_generators_start_alike_whatever_was_driven_before(
    guard: Guard, make_guard: Callable[..., Guard]
) -> None:
    alone = guard.drive(task("Draws"))
    other = make_guard()
    other.drive(task("Reseeds"))
    other.drive(task("Draws", seed=3))
    again = other.drive(task("Draws"))
    assert alone.outcome is Outcome.COMPLETED
    assert again.trace.digest == alone.trace.digest
    assert other.drive(task("Draws", seed=3)).trace.digest != alone.trace.digest


def test_what_is_printed_is_kept_only_at_its_end(make_guard: Callable[..., Guard]) -> None:
    guard = make_guard(Limits(episode_s=20.0, output_bytes=1000))
    assert guard.drive(task("Shouts")).outcome is Outcome.COMPLETED
    assert guard.output.endswith("\\udcff the last words\n")
    assert "�" in guard.output
    assert len(guard.output) <= 1000
    guard.drive(task("Steady"))
    assert guard.output == ""


@pytest.mark.parametrize("agent", ["LeavesAThread", "ClosesItsStreams", "Forks"])
def test_a_process_that_is_not_as_before_is_replaced(guard: Guard, agent: str) -> None:
    steady = guard.drive(task("Steady"))
    pid = guard.pid
    assert guard.drive(task(agent)).trace.digest == steady.trace.digest
    assert guard.pid is None
    assert pid is not None
    assert gone_within(pid, 5.0)
    assert guard.drive(task("Steady")).trace.digest == steady.trace.digest


@pytest.mark.parametrize("agent", ["LeavesAChild", "LeavesADaemon"])
def test_processes_that_an_agent_leaves_end_with_its_episode(
    guard: Guard, noted_pid: Callable[[], int], agent: str
) -> None:
    assert guard.drive(task(agent)).outcome is Outcome.COMPLETED
    assert gone_within(noted_pid(), 5.0)
    assert guard.drive(task("Steady")).outcome is Outcome.COMPLETED


@pytest.mark.parametrize("agent", ["LeavesADaemonAndDies", "LeavesADaemonAndHangs"])
def test_processes_of_an_agent_that_was_lost_end_too(guard: Guard, noted_pid: Callable[[], int], agent: str) -> None:
    assert guard.drive(task(agent)).outcome is Outcome.AGENT_ERROR
    assert gone_within(noted_pid(), 5.0)


def test_a_process_that_grew_too_much_is_replaced(make_guard: Callable[..., Guard]) -> None:
    guard = make_guard(Limits(growth_bytes=30 << 20))
    pids = set()
    for _ in range(10):
        assert guard.drive(task("Leaks")).outcome is Outcome.COMPLETED
        pids.add(guard.pid)
    assert 2 <= len(pids - {None}) <= 5


@pytest.mark.slow
def test_a_leak_over_200_episodes_never_takes_much_memory(make_guard: Callable[..., Guard]) -> None:
    guard = make_guard(Limits(growth_bytes=100 << 20))
    largest = 0
    for _ in range(200):
        assert guard.drive(task("Leaks")).outcome is Outcome.COMPLETED
        if guard.pid is not None and alive(guard.pid):
            largest = max(largest, int(Path(f"/proc/{guard.pid}/statm").read_text().split()[1]) * 4096)
    assert largest < 300 << 20


@pytest.mark.slow
def test_the_memory_of_a_process_does_not_grow_over_500_episodes(guard: Guard) -> None:
    sizes = []
    for _ in range(500):
        assert guard.drive(task("Steady")).outcome is Outcome.COMPLETED
        assert guard.pid is not None
        sizes.append(int(Path(f"/proc/{guard.pid}/statm").read_text().split()[1]) * 4096)
    assert sizes[-1] - sizes[50] < 2 << 20
