"""Whose fault an episode's end is: the agent's, the world's, or the user's at the keyboard."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.perturbations import Perturbation, Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent, fake_route

FULL = Control(throttle=1.0)
FAULT_TICK = 30


def drive(agent: object, *, simulator: FakeSimulator | None = None, setting: Setting = Setting.CLEAN) -> EpisodeResult:
    return drive_episode(
        simulator or FakeSimulator(),
        agent,  # type: ignore[arg-type]
        route=fake_route(),
        setting=setting,
        seed=0,
        agent_name="under test",
    )


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
        (crash, r"act raised ZeroDivisionError: division by zero \(.*test_loop_faults\.py:\d+ in crash\)"),
        (lambda: sys.exit("bye"), "act raised SystemExit: bye"),
        (lambda: np.zeros((2, 2)) @ np.zeros((3, 3)), r"act raised ValueError: .*test_loop_faults\.py:\d+"),
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


@pytest.mark.parametrize("method", ["reset", "observe", "step", "score"])
def test_what_the_world_does_wrong_is_never_scored(method: str) -> None:
    simulator = FakeSimulator(raises=RuntimeError("lost the server"), raises_in=method)
    result = drive(ScriptedAgent([FULL]), simulator=simulator)
    assert (result.outcome, result.end) == (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED)
    assert (result.route_completion_pct, result.infractions) == (0.0, ())
    assert "RuntimeError: lost the server" in result.end_detail


def test_a_world_that_breaks_later_keeps_the_trace() -> None:
    simulator = FakeSimulator(raises=SimulationError("lost the server"), raises_at=25)
    result = drive(ScriptedAgent([FULL]), simulator=simulator)
    assert (result.outcome, result.ticks, len(result.trace.rows)) == (Outcome.INFRA_ERROR, 25, 25)
    assert result.end_detail == "lost the server"


def test_a_world_that_says_that_it_crashed_is_believed() -> None:
    simulator = FakeSimulator(ends=End.SIMULATION_CRASHED, ends_at=5)
    assert drive(ScriptedAgent([FULL]), simulator=simulator).outcome is Outcome.INFRA_ERROR


def test_a_perturbation_that_raises_is_not_blamed_on_the_agent() -> None:
    @dataclass
    class Short(Perturbation):
        phrase = "short circuit"

        def observe(self, observation: Observation) -> Observation:
            raise OSError("short circuit")

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Short()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert "short circuit" in result.end_detail
    assert "test_loop_faults.py" in result.end_detail


def test_a_perturbation_that_invents_an_impossible_control_is_not_blamed_on_the_agent() -> None:
    @dataclass
    class Runaway(Perturbation):
        phrase = "runaway"

        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return Control(throttle=float("nan"))

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Runaway()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert "the perturbations gave the vehicle" in result.end_detail


def test_ctrl_c_goes_through() -> None:
    def interrupt() -> object:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        drive(after_a_while(interrupt))


def test_what_pytest_raises_for_a_timeout_goes_through() -> None:
    with pytest.raises(pytest.fail.Exception, match="Timeout"):
        drive(after_a_while(lambda: pytest.fail("Timeout")))


def test_a_simulator_that_leaves_by_sys_exit_is_not_an_agent_error() -> None:
    class Leaving(FakeSimulator):
        def plan(self) -> GlobalPlan:
            sys.exit(9)

    with pytest.raises(SystemExit):
        drive(ScriptedAgent([FULL]), simulator=Leaving())
