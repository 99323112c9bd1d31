"""What an agent does to its process beyond its own memory never reaches the next episode."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from guarded_worlds import FAKE, alive, gone_within, request

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.engine.fork_server import ForkServer
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.engine.worker_setup import Limits

TORCH_IN_THE_DRIVE = Limits(episode_s=300.0)
"""Loading torch may take longer than other tests let an agent act."""


@pytest.fixture
def noted_pid(fork_server: ForkServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[], int]:
    """The process that an agent left and told of."""
    fork_server.close()  # the next one has the environment of this test
    note = tmp_path / "note"
    monkeypatch.setenv("DRIVE_ROBUST_TEST_NOTE", str(note))
    return lambda: int(note.read_text())


def surroundings(supervisor: Supervisor) -> object:
    detail = supervisor.drive(request("TellsItsSurroundings")).end_detail
    return json.loads(detail.partition("RuntimeError: ")[2].rpartition(" (")[0])


def test_everything_that_can_be_put_back_is_put_back(supervisor: Supervisor) -> None:
    before = surroundings(supervisor)
    pid = supervisor.pid
    assert supervisor.drive(request("MeddlesWithEverything")).outcome is Outcome.COMPLETED
    assert surroundings(supervisor) == before
    assert supervisor.pid == pid


@pytest.mark.slow
def test_torch_is_put_back_as_it_was_loaded_whoever_loaded_it(make_supervisor: Callable[..., Supervisor]) -> None:
    alone = make_supervisor(TORCH_IN_THE_DRIVE).drive(request("TellsTorch")).end_detail
    assert "'highest'" in alone
    other = make_supervisor(TORCH_IN_THE_DRIVE)
    first = other.drive(request("SetsTorch"))
    pid = other.pid
    assert first.outcome is Outcome.COMPLETED
    assert other.drive(request("TellsTorch")).end_detail == alone
    assert other.drive(request("SetsTorch")).trace.digest == first.trace.digest  # it has what it set itself again
    broken = {other.drive(request("SetsTorchAndRaises")).end_detail for _ in range(2)}
    assert len(broken) == 1
    assert "'tf32'" in broken.pop()
    assert other.pid == pid is not None


@pytest.mark.slow
def test_torch_is_put_back_also_when_it_is_loaded_in_the_drive(make_supervisor: Callable[..., Supervisor]) -> None:
    supervisor = make_supervisor(TORCH_IN_THE_DRIVE)
    first = supervisor.drive(request("LoadsTorchInTheDrive"))
    pid = supervisor.pid
    assert first.outcome is Outcome.COMPLETED
    assert supervisor.drive(request("LoadsTorchInTheDrive")).trace.digest == first.trace.digest
    assert supervisor.pid == pid is not None


def test_a_process_that_computes_without_subnormals_is_replaced(supervisor: Supervisor) -> None:
    first = supervisor.drive(request("FlushesByOnnxRuntime"))
    assert first.outcome is Outcome.COMPLETED
    assert supervisor.pid is None
    assert first.trace.digest != supervisor.drive(request("Steady")).trace.digest


def test_a_folder_that_is_gone_does_no_harm(supervisor: Supervisor) -> None:
    before = surroundings(supervisor)
    assert supervisor.drive(request("MovesIntoAFolderThatGoesAway")).outcome is Outcome.COMPLETED
    assert surroundings(supervisor) == before


def test_the_global_generators_start_alike_whatever_was_driven_before(
    supervisor: Supervisor, make_supervisor: Callable[..., Supervisor]
) -> None:
    alone = supervisor.drive(request("Draws"))
    other = make_supervisor()
    other.drive(request("Reseeds"))
    other.drive(request("Draws", seed=3))
    again = other.drive(request("Draws"))
    assert alone.outcome is Outcome.COMPLETED
    assert again.trace.digest == alone.trace.digest
    assert other.drive(request("Draws", seed=3)).trace.digest != alone.trace.digest


def test_strings_have_the_same_hashes_in_every_run_whatever_seed_tox_or_a_user_sets(
    make_supervisor: Callable[..., Supervisor], monkeypatch: pytest.MonkeyPatch
) -> None:
    def driven() -> str:
        return make_supervisor(simulator=FAKE).drive(request("DrivesByHashes")).trace.digest

    monkeypatch.delenv("PYTHONHASHSEED", raising=False)
    usual = driven()
    monkeypatch.setenv("PYTHONHASHSEED", "77")
    assert driven() == usual


def test_what_is_printed_is_kept_only_at_its_end(make_supervisor: Callable[..., Supervisor]) -> None:
    supervisor = make_supervisor(Limits(episode_s=300.0, output_bytes=1000))
    assert supervisor.drive(request("Shouts")).outcome is Outcome.COMPLETED
    assert supervisor.output.endswith("\\udcff the last words\n")
    assert "�" in supervisor.output
    assert len(supervisor.output) <= 1000
    supervisor.drive(request("Steady"))
    assert supervisor.output == ""


@pytest.mark.parametrize("agent", ["LeavesAThread", "ClosesItsStreams", "Forks"])
def test_a_process_that_is_not_as_before_is_replaced(supervisor: Supervisor, agent: str) -> None:
    steady = supervisor.drive(request("Steady"))
    pid = supervisor.pid
    assert supervisor.drive(request(agent)).trace.digest == steady.trace.digest
    assert supervisor.pid is None
    assert pid is not None
    assert gone_within(pid)
    assert supervisor.drive(request("Steady")).trace.digest == steady.trace.digest


@pytest.mark.parametrize("agent", ["LeavesAChild", "LeavesADaemon"])
def test_processes_that_an_agent_leaves_end_with_its_episode(
    supervisor: Supervisor, noted_pid: Callable[[], int], agent: str
) -> None:
    assert supervisor.drive(request(agent)).outcome is Outcome.COMPLETED
    assert gone_within(noted_pid())
    assert supervisor.drive(request("Steady")).outcome is Outcome.COMPLETED


@pytest.mark.parametrize("agent", ["LeavesADaemonAndDies", "LeavesADaemonAndHangs"])
def test_processes_of_an_agent_that_was_lost_end_too(
    supervisor: Supervisor, noted_pid: Callable[[], int], agent: str
) -> None:
    assert supervisor.drive(request(agent)).outcome is Outcome.AGENT_ERROR
    assert gone_within(noted_pid())


def test_a_process_that_grew_too_much_is_replaced(make_supervisor: Callable[..., Supervisor]) -> None:
    supervisor = make_supervisor(Limits(growth_bytes=30 << 20))
    pids = set()
    for _ in range(10):
        assert supervisor.drive(request("Leaks")).outcome is Outcome.COMPLETED
        pids.add(supervisor.pid)
    assert 2 <= len(pids - {None}) <= 5


def own_bytes(pid: int) -> int:
    """Return the memory of a process without that of files, which the system takes and gives as others need it."""
    pages = Path(f"/proc/{pid}/statm").read_text().split()
    return (int(pages[1]) - int(pages[2])) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.slow
def test_a_leak_over_200_episodes_never_takes_much_memory(make_supervisor: Callable[..., Supervisor]) -> None:
    supervisor = make_supervisor(Limits(growth_bytes=100 << 20))
    largest = 0
    for _ in range(200):
        assert supervisor.drive(request("Leaks")).outcome is Outcome.COMPLETED
        if supervisor.pid is not None and alive(supervisor.pid):
            largest = max(largest, own_bytes(supervisor.pid))
    assert largest < 300 << 20


@pytest.mark.slow
def test_the_memory_of_a_process_does_not_grow_over_500_episodes(supervisor: Supervisor) -> None:
    sizes = []
    for _ in range(500):
        assert supervisor.drive(request("Steady")).outcome is Outcome.COMPLETED
        assert supervisor.pid is not None
        sizes.append(own_bytes(supervisor.pid))
    assert sizes[-1] - sizes[50] < 2 << 20
