"""What an agent does wrong is blamed on it and ends its episode, of which what was driven stays."""

from __future__ import annotations

import builtins
import os
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from episode_loop import FULL, drive

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.store.reuse import is_reusable
from pytest_drive_robust.testing import ScriptedAgent

FAULT_TICK = 30


def after_a_while(fault: Callable[[], object]) -> ScriptedAgent:
    """Drives well, then does `fault()` in tick 30."""

    def act(observation: Observation) -> Control:
        return FULL if observation.tick < FAULT_TICK else fault()  # type: ignore[return-value]

    return ScriptedAgent(act)


def crash() -> object:
    return 1 / 0


@pytest.mark.parametrize(
    ("fault", "detail"),
    [
        (crash, r"act raised ZeroDivisionError: division by zero \(.*test_loop_blames_agents\.py:\d+ in crash\)"),
        (lambda: sys.exit("bye"), "act raised SystemExit: bye"),
        (lambda: np.zeros((2, 2)) @ np.zeros((3, 3)), r"act raised ValueError: .*test_loop_blames_agents\.py:\d+"),
        (lambda: Control(steer=float("nan")), "steer is nan"),
        (lambda: Control(throttle=float("inf")), "throttle is inf"),
        (lambda: Control(steer=-1.01), r"steer is -1\.01, expected a number in -1\.\.1"),
        (lambda: Control(brake=-0.1), r"brake is -0\.1"),
        (lambda: Control(throttle=None), "throttle is None"),  # type: ignore[arg-type]
        (lambda: None, "act returned None of type NoneType, expected a Control"),
        (lambda: (1.0, 0.0, 0.0), r"act returned \(1\.0, 0\.0, 0\.0\) of type tuple"),
        (lambda: {"throttle": 1.0}, "of type dict"),
    ],
)
def test_what_an_agent_does_wrong_ends_its_episode_and_keeps_what_was_driven(
    fault: Callable[[], object], detail: str
) -> None:
    result = drive(after_a_while(fault))
    assert (result.outcome, result.end, result.ticks) == (Outcome.AGENT_ERROR, End.AGENT_CRASHED, FAULT_TICK)
    assert 0.0 < result.route_completion_pct < 100.0
    assert result.route_length_m == 60.0
    with pytest.raises(AssertionError, match=detail):
        raise AssertionError(result.end_detail)


def test_an_agent_that_fails_in_reset_has_driven_nothing() -> None:
    class Forgetful(ScriptedAgent):
        def reset(self, route: GlobalPlan, seed: int) -> None:
            raise KeyError("weights")

    result = drive(Forgetful([FULL]))
    assert (result.outcome, result.ticks, result.trace.rows.shape) == (Outcome.AGENT_ERROR, 0, (0, 11))
    assert result.end_detail.startswith("reset raised KeyError: 'weights'")


class Awaited(ScriptedAgent):
    async def reset(self, route: GlobalPlan, seed: int) -> None:  # type: ignore[override]
        raise AssertionError("not reached")


class Suspended(ScriptedAgent):
    def reset(self, route: GlobalPlan, seed: int) -> Iterator[None]:  # type: ignore[override]
        yield


class AwaitedAndSuspended(ScriptedAgent):
    async def reset(self, route: GlobalPlan, seed: int) -> AsyncIterator[None]:  # type: ignore[override]
        yield


@pytest.mark.parametrize("agent", [Awaited, Suspended, AwaitedAndSuspended])
def test_a_reset_of_which_nothing_ran_is_a_fault(agent: type[ScriptedAgent]) -> None:
    result = drive(agent([FULL]))
    assert (result.outcome, result.ticks) == (Outcome.AGENT_ERROR, 0)
    assert result.end_detail.startswith("reset is a coroutine or generator, so nothing of it ran")


def test_the_folder_that_an_agent_removed_does_not_hide_what_it_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def leave() -> object:
        gone = tmp_path / "gone"
        gone.mkdir()
        os.chdir(gone)
        gone.rmdir()
        raise ValueError("no map")

    monkeypatch.chdir(tmp_path)
    result = drive(after_a_while(leave))
    assert (result.outcome, result.end) == (Outcome.AGENT_ERROR, End.AGENT_CRASHED)
    assert result.end_detail.startswith("act raised ValueError: no map (")


@pytest.mark.skipif(sys.version_info < (3, 11), reason="exceptions have neither notes nor groups")
def test_notes_and_groups_do_not_hide_what_an_agent_raised() -> None:
    def tasks() -> object:
        shortage = MemoryError("x")
        shortage.add_note("while planning")  # type: ignore[attr-defined]
        raise builtins.ExceptionGroup("tasks", [shortage, KeyError("map")])  # type: ignore[attr-defined]

    result = drive(after_a_while(tasks))
    told = "act raised ExceptionGroup: tasks (2 sub-exceptions); MemoryError: x; while planning; KeyError: 'map' ("
    assert result.end_detail.startswith(told)
    assert not is_reusable(result)


@pytest.mark.parametrize("attribute", ["consumes", "privileged"])
def test_an_agent_is_to_blame_for_what_its_attributes_raise(attribute: str) -> None:
    def unread(self: object) -> object:
        raise OSError("no such sensor")

    passed_over = property(unread, lambda self, given: None)
    agent = type("Broken", (ScriptedAgent,), {attribute: passed_over})([FULL])
    result = drive(agent)
    assert (result.outcome, result.end) == (Outcome.AGENT_ERROR, End.AGENT_CRASHED)
    assert result.end_detail.startswith(f"{attribute} raised OSError: no such sensor (")


@pytest.mark.parametrize(
    ("cameras", "detail"),
    [
        ([CameraSpec("front"), CameraSpec("front")], "two cameras named 'front'"),
        ([CameraSpec("front", width_px=0)], r"width_px is 0, expected a whole number in 1\.\.4096"),
        ([CameraSpec("front", height_px=4097)], "height_px is 4097"),
        ([CameraSpec("front", width_px=25.5)], r"width_px is 25\.5"),  # type: ignore[arg-type]
        ([CameraSpec("front", fov_deg=180.0)], r"fov_deg is 180, expected 1\.\.179"),
        ([CameraSpec("front", fov_deg=float("nan"))], "fov_deg is nan"),
        ([CameraSpec("front", rate_hz=0.0)], "rate_hz is 0, expected a rate that divides 20 Hz, such as 20, 10, 5"),
        ([CameraSpec("front", rate_hz=7.0)], "rate_hz is 7"),
        ([CameraSpec("front", rate_hz=40.0)], "rate_hz is 40"),
        ([CameraSpec("")], "its name is ''"),
        ([("front", 256, 144)], "expected a CameraSpec"),
        (None, "sensors returned None, expected a list of CameraSpec"),
    ],
)
def test_cameras_that_cannot_be_are_the_agents_error(cameras: object, detail: str) -> None:
    class Rig(ScriptedAgent):
        def sensors(self) -> tuple[CameraSpec, ...]:
            return cameras  # type: ignore[return-value]

    result = drive(Rig([FULL]))
    assert (result.outcome, result.ticks, result.route_completion_pct) == (Outcome.AGENT_ERROR, 0, 0.0)
    with pytest.raises(AssertionError, match=detail):
        raise AssertionError(result.end_detail)


@pytest.mark.parametrize("rate_hz", [20.0, 10.0, 5.0, 4.0, 2.0, 1.0])
def test_rates_that_divide_the_tick_rate_are_fine(rate_hz: float) -> None:
    agent = ScriptedAgent([FULL], cameras=[CameraSpec("front", width_px=4, height_px=4, rate_hz=rate_hz)])
    assert drive(agent).outcome is Outcome.COMPLETED


def test_ctrl_c_goes_through() -> None:
    def interrupt() -> object:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        drive(after_a_while(interrupt))


def test_what_pytest_raises_for_a_timeout_goes_through() -> None:
    with pytest.raises(pytest.fail.Exception, match="Timeout"):
        drive(after_a_while(lambda: pytest.fail("Timeout")))


@pytest.mark.parametrize(
    ("consumes", "detail"),
    [
        ("gps", "consumes is 'gps', expected a set of names"),
        (3, "consumes is 3, expected a set of names"),
        ({"camera"}, "consumes has 'camera', which is no signal. Did you mean 'cameras'?"),
    ],
)
def test_signals_that_cannot_be_are_the_agents_error(consumes: object, detail: str) -> None:
    agent = ScriptedAgent([FULL])
    agent.consumes = consumes  # type: ignore[attr-defined]
    result = drive(agent)
    assert result.outcome is Outcome.AGENT_ERROR
    assert detail in result.end_detail
