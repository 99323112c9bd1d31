"""Whatever an agent does to its process, its episode has a result with a score, and the next one is not touched."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable

import guarded_agents
import numpy as np
import pytest
from guarded_worlds import ROUTE, request
from patience import PATIENCE_S

from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.engine import exchange
from pytest_drive_robust.engine.awake_clock import AwakeClock
from pytest_drive_robust.engine.supervisor import Supervisor
from pytest_drive_robust.engine.worker_setup import Limits
from pytest_drive_robust.perturbations import InferenceLatency, Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.testing import FakeSimulator, fake_route

FAULT_TICK = guarded_agents.FAULT_TICK


def inline(agent: type[guarded_agents.Steady], setting: Setting = Setting.CLEAN) -> EpisodeResult:
    made = agent()
    return drive_episode(
        FakeSimulator(), made, route=ROUTE, setting=setting, seed=0, agent_name=f"guarded_agents:{agent.__name__}"
    )


def assert_lost_in_act(result: EpisodeResult, end: End) -> None:
    """The episode is scored exactly as if the agent had raised in that tick."""
    raised = inline(guarded_agents.Raises)
    assert (result.outcome, result.end, result.ticks) == (Outcome.AGENT_ERROR, end, FAULT_TICK)
    assert result.route_completion_pct == raised.route_completion_pct > 0.0
    assert result.route_length_m == raised.route_length_m
    assert result.trace.digest == raised.trace.digest
    assert result.reception == raised.reception


def assert_still_fine(supervisor: Supervisor) -> None:
    """The next episode of the same supervisor is what it is in a fresh process."""
    result = supervisor.drive(request("Steady"))
    assert (result.outcome, result.trace.digest) == (Outcome.COMPLETED, inline(guarded_agents.Steady).trace.digest)


@pytest.mark.parametrize(
    ("agent", "detail"),
    [
        ("Raises", "act raised ZeroDivisionError: no way (tests/helpers/guarded_agents.py:"),
        ("SaysExit", "act raised SystemExit: enough"),
        ("Interrupts", "act raised KeyboardInterrupt: from within (tests/helpers/guarded_agents.py:"),
        ("RaisesWhatCannotBePickled", "OddError: two arguments"),
        ("GivesNan", "steer is nan"),
        ("GivesInfinity", "throttle is inf"),
        ("GivesNothing", "act returned None"),
        ("GivesATuple", "of type tuple, expected a Control"),
        ("GivesTooMuch", "brake is 1.5"),
    ],
)
def test_what_is_raised_or_returned_ends_the_episode_and_not_the_process(
    supervisor: Supervisor, agent: str, detail: str
) -> None:
    assert_still_fine(supervisor)
    pid = supervisor.pid
    result = supervisor.drive(request(agent))
    assert_lost_in_act(result, End.AGENT_CRASHED)
    assert detail in result.end_detail
    assert_still_fine(supervisor)
    assert supervisor.pid == pid


@pytest.mark.parametrize(
    ("agent", "detail"),
    [
        ("Segfaults", "SIGSEGV in act at tick 30 (tests/helpers/guarded_agents.py:"),
        ("Aborts", "SIGABRT in act at tick 30"),
        ("Leaves", "left the process with exit code 0 in act at tick 30"),
        ("LeavesWithSeven", "left the process with exit code 7 in act at tick 30"),
        ("ClosesEverything", "closed the descriptors of its process"),
        ("WritesToEveryDescriptor", "wrote to the descriptors of its process"),
    ],
)
def test_what_ends_the_process_is_scored_up_to_there(supervisor: Supervisor, agent: str, detail: str) -> None:
    result = supervisor.drive(request(agent))
    assert detail in result.end_detail
    if detail.startswith("wrote"):  # noticed a moment later
        assert (result.outcome, result.end) == (Outcome.AGENT_ERROR, End.AGENT_CRASHED_HARD)
        assert result.ticks >= FAULT_TICK
    else:
        assert_lost_in_act(result, End.AGENT_CRASHED_HARD)
    assert_still_fine(supervisor)


def test_the_last_line_that_was_printed_is_told(supervisor: Supervisor) -> None:
    result = supervisor.drive(request("Aborts"))
    assert "it last printed 'cannot go on'" in result.end_detail
    assert "cannot go on" in supervisor.output


@pytest.mark.parametrize(
    ("agent", "call"),
    [("SegfaultsInReset", "reset"), ("SegfaultsInSensors", "reset"), ("SegfaultsWhenMade", "its constructor")],
)
def test_an_agent_that_dies_before_it_drives_has_driven_nothing(supervisor: Supervisor, agent: str, call: str) -> None:
    result = supervisor.drive(request(agent))
    assert (result.outcome, result.end, result.ticks) == (Outcome.AGENT_ERROR, End.AGENT_CRASHED_HARD, 0)
    assert f"SIGSEGV in {call} at tick 0" in result.end_detail
    assert_still_fine(supervisor)


@pytest.mark.parametrize("agent", ["Hangs", "HangsDeaf", "HangsInC", "StopsItself"])
def test_a_call_that_does_not_return_is_cut_off_in_time(supervisor: Supervisor, agent: str) -> None:
    assert_still_fine(supervisor)
    result = supervisor.drive(request(agent))
    assert_lost_in_act(result, End.AGENT_TIMED_OUT)
    assert result.end_detail.startswith("took longer than 2 s in act at tick 30")
    assert_still_fine(supervisor)


def test_time_in_which_everything_was_stopped_is_no_time_of_the_agent(
    supervisor: Supervisor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a container that is paused for an hour, here by the clock alone."""
    begun_s = time.monotonic()

    def paused() -> AwakeClock:
        readings = iter([0.0, 0.0])
        return AwakeClock(lambda: time.monotonic() + next(readings, 3600.0))

    monkeypatch.setattr(exchange, "AwakeClock", paused)
    assert_still_fine(supervisor)
    assert_lost_in_act(supervisor.drive(request("Hangs")), End.AGENT_TIMED_OUT)
    assert time.monotonic() - begun_s < PATIENCE_S


@pytest.mark.parametrize("agent", ["Hangs", "HangsInC"])
def test_where_a_call_hung_is_told(supervisor: Supervisor, agent: str) -> None:
    assert "(tests/helpers/guarded_agents.py:" in supervisor.drive(request(agent)).end_detail


def test_a_reset_that_does_not_return_is_cut_off(supervisor: Supervisor) -> None:
    result = supervisor.drive(request("HangsInReset"))
    assert (result.outcome, result.end, result.ticks) == (Outcome.AGENT_ERROR, End.AGENT_TIMED_OUT, 0)
    assert "in reset at tick 0" in result.end_detail


def test_many_slow_calls_are_too_slow_together(make_supervisor: Callable[..., Supervisor]) -> None:
    result = make_supervisor(Limits(episode_s=3.0)).drive(request("Dawdles", route=fake_route(length_m=5000.0)))
    assert (result.outcome, result.end) == (Outcome.AGENT_ERROR, End.AGENT_TIMED_OUT)
    assert "the episode took longer than 3 s, the agent used " in result.end_detail
    assert 0 < result.ticks < 2000  # some calls, and not to the end: a tick takes 20 ms
    assert result.route_completion_pct > 0.0


def test_a_worker_that_dies_before_its_agent_is_made_is_no_fault_of_the_agent(
    make_supervisor: Callable[..., Supervisor],
) -> None:
    result = make_supervisor(Limits(episode_s=300.0, memory_bytes=50_000_000)).drive(request("Steady"))
    assert (result.outcome, result.end) == (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED)
    assert "constructor" not in result.end_detail


def test_memory_without_end_is_refused(make_supervisor: Callable[..., Supervisor]) -> None:
    supervisor = make_supervisor(Limits(episode_s=300.0, memory_bytes=700_000_000))
    result = supervisor.drive(request("TakesTooMuchMemory"))
    assert_lost_in_act(result, End.AGENT_CRASHED_HARD)
    assert "MemoryError" in result.end_detail
    assert "may allocate 700 MB" in result.end_detail
    assert_still_fine(supervisor)


def test_memory_that_earlier_agents_hold_in_the_process_is_not_missed(
    make_supervisor: Callable[..., Supervisor],
) -> None:
    supervisor = make_supervisor(Limits(episode_s=300.0, memory_bytes=700_000_000))
    for agent in ("HoldsMemory", "HoldsMemoryToo", "HoldsMemoryFromTheStart"):
        result = supervisor.drive(request(agent))
        assert result.outcome is Outcome.COMPLETED, result.end_detail


@pytest.mark.parametrize("agent", ["KillsItself", "KillsTheForkServer"])
def test_a_process_that_is_killed_every_time_is_the_agents_failure_in_the_end(
    supervisor: Supervisor, agent: str
) -> None:
    result = supervisor.drive(request(agent))
    assert_lost_in_act(result, End.AGENT_CRASHED_HARD)
    assert "killed by SIGKILL in act at tick 30 (perhaps out of memory), 3 times" in result.end_detail
    assert_still_fine(supervisor)


def test_a_process_that_somebody_kills_once_is_driven_again(supervisor: Supervisor) -> None:
    assert_still_fine(supervisor)
    killed: list[int] = []

    def kill_when_under_way() -> None:
        while supervisor.ticks < 5:
            time.sleep(0.001)
        killed.append(supervisor.pid or 0)
        os.kill(killed[0], signal.SIGKILL)

    killer = threading.Thread(target=kill_when_under_way, daemon=True)
    killer.start()
    result = supervisor.drive(request("Dawdles"))
    killer.join(PATIENCE_S)
    assert killed
    assert killed[0] != supervisor.pid
    assert (result.outcome, result.trace.digest) == (Outcome.COMPLETED, inline(guarded_agents.Steady).trace.digest)


def test_a_score_after_a_death_counts_what_the_setting_did(supervisor: Supervisor) -> None:
    setting = Setting.of(InferenceLatency(ms=200.0))
    result = supervisor.drive(request("Segfaults", setting=setting))
    raised = inline(guarded_agents.Raises, setting)
    assert (result.trace.digest, result.schedule) == (raised.trace.digest, raised.schedule)
    assert result.schedule
    assert result.reception == raised.reception
    assert result.episode.setting == "200 ms latency"


def test_a_score_after_a_death_survives_measured_latency(supervisor: Supervisor) -> None:
    setting = Setting.parse("measured latency")
    result = supervisor.drive(request("Segfaults", setting=setting))
    assert (result.outcome, result.ticks) == (Outcome.AGENT_ERROR, FAULT_TICK)
    assert result.route_completion_pct > 0.0


def test_observations_belong_to_the_agent(supervisor: Supervisor) -> None:
    first, second = supervisor.drive(request("Scribbles")), supervisor.drive(request("Scribbles"))
    assert first.outcome is Outcome.COMPLETED
    assert first.trace.digest == second.trace.digest == inline(guarded_agents.Scribbles).trace.digest
    assert np.ptp(first.trace.column("throttle")) == 0.0
