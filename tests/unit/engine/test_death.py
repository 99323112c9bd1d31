"""Who is to blame for an episode without an answer, and in which words."""

from __future__ import annotations

import signal

import pytest

from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.engine.death import Blame, Cause, Death, explain, place_of_fault
from pytest_drive_robust.engine.shared_state import Phase, StateReading

ACT = StateReading(Phase.ACT, 12, 0.0, 0.0)
SIM = StateReading(Phase.SIM, 12, 0.0, 0.0)

FAULTS = """Fatal Python error: Segmentation fault

Current thread 0x00007f (most recent call first):
  File "/usr/lib/python3.11/ctypes/__init__.py", line 519 in string_at
  File "/venv/lib/python3.11/site-packages/somewhere/fast.py", line 3 in call
  File "/home/me/agent.py", line 17 in act
  File "/home/me/other.py", line 2 in run
"""


@pytest.mark.parametrize(
    ("reading", "status", "blame", "detail"),
    [
        (ACT, int(signal.SIGSEGV), Blame.AGENT, "SIGSEGV in act at tick 12"),
        (ACT, 3 << 8, Blame.AGENT, "left the process with exit code 3 in act at tick 12"),
        (ACT, 0, Blame.AGENT, "left the process with exit code 0 in act at tick 12"),
        (SIM, int(signal.SIGSEGV), Blame.OURS, "the simulation ended its process: SIGSEGV at tick 12"),
        (SIM, int(signal.SIGKILL), Blame.OUTSIDE, "killed by SIGKILL at tick 12 (perhaps out of memory)"),
        (ACT, int(signal.SIGTERM), Blame.OUTSIDE, "killed by SIGTERM in act at tick 12"),
        (
            StateReading(Phase.IDLE, 0, 0.0, 0.0),
            int(signal.SIGKILL),
            Blame.OURS,
            "killed by SIGKILL before the episode began",
        ),
        (
            StateReading(Phase.MAKE, 0, 0.0, 0.0),
            int(signal.SIGKILL),
            Blame.OUTSIDE,
            "killed by SIGKILL in its constructor at tick 0 (perhaps out of memory)",
        ),
        (ACT, 71 << 8, Blame.AGENT, "closed the descriptors of its process in act at tick 12"),
        (StateReading(Phase.MAKE, 0, 0.0, 0.0), 1 << 8, Blame.AGENT, "exit code 1 in its constructor at tick 0"),
    ],
)
def test_who_died_where_says_whose_fault_it_was(reading: StateReading, status: int, blame: Blame, detail: str) -> None:
    finding = explain(Death(Cause.DIED, reading, status=status))
    assert finding.blame is blame
    assert finding.detail.endswith(detail)
    assert finding.end is (End.SIMULATION_CRASHED if blame is Blame.OURS else End.AGENT_CRASHED_HARD)


@pytest.mark.parametrize(
    ("reading", "lasted_s", "blame"),
    [
        (StateReading(Phase.SIM, 9, 0.0, 6.0), 0.1, Blame.AGENT),
        (StateReading(Phase.SIM, 9, 0.0, 4.0), 0.1, Blame.OURS),
        (StateReading(Phase.SIM, 9, 0.0, 1.0), 8.0, Blame.OURS),
        (StateReading(Phase.ACT, 9, 0.0, 1.0), 8.0, Blame.AGENT),
        (StateReading(Phase.ACT, 9, 0.0, 1.0), 1.0, Blame.OURS),
    ],
)
def test_the_time_of_an_episode_is_charged_to_who_used_more_of_it(
    reading: StateReading, lasted_s: float, blame: Blame
) -> None:
    death = Death(Cause.EPISODE_DEADLINE, reading, limit_s=10.0, lasted_s=lasted_s, elapsed_s=10.0)
    assert explain(death).blame is blame


def test_the_last_line_on_the_screen_is_told_but_not_all_of_it() -> None:
    death = Death(Cause.DIED, ACT, status=int(signal.SIGABRT), printed="first\n" + "x" * 1000 + "\n\n")
    assert explain(death).detail == "SIGABRT in act at tick 12; it last printed '" + "x" * 200 + "'"


def test_the_place_of_a_fault_is_the_agents_own_line() -> None:
    assert place_of_fault(FAULTS) == " (/home/me/agent.py:17 in act)"


def test_a_handler_of_the_agents_own_is_believed() -> None:
    printed = f"{FAULTS}\nExtension modules: numpy.core (total: 1)\n"
    detail = explain(Death(Cause.DIED, ACT, status=int(signal.SIGSEGV), printed=printed)).detail
    assert detail.startswith("SIGSEGV in act at tick 12 (/home/me/agent.py:17 in act)")
    assert "Extension modules" not in detail


def test_a_fault_within_libraries_only_is_placed_there() -> None:
    assert (
        place_of_fault("\n".join(FAULTS.splitlines()[:4]))
        == " (/usr/lib/python3.11/ctypes/__init__.py:519 in string_at)"
    )


@pytest.mark.parametrize("faults", ["", "Fatal Python error: Segmentation fault\n", "\x00\xff nonsense"])
def test_no_place_is_no_problem(faults: str) -> None:
    assert place_of_fault(faults) == ""
