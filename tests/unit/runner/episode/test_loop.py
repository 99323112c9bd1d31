"""The closed loop with a tiny world: what the agent gets, what the vehicle gets, whose fault the end is."""

from __future__ import annotations

import builtins
import math
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Injection
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.perturbations import (
    BurstFrameDrop,
    EpisodeContext,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    SensorDelay,
    Setting,
)
from pytest_drive_robust.runner.episode.loop import Watch, drive_episode
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.routes import named_routes
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.store.reuse import is_reusable
from pytest_drive_robust.testing import FakeSimulator, RecordingAgent, ScriptedAgent, fake_route

CAMERA = CameraSpec("front", width_px=16, height_px=9)
FULL = Control(throttle=1.0)
FAULT_TICK = 30


def drive(
    agent: object,
    *,
    simulator: Simulator | None = None,
    setting: Setting = Setting.CLEAN,
    seed: int = 3,
    **options: object,
) -> EpisodeResult:
    return drive_episode(
        simulator or FakeSimulator(),
        agent,  # type: ignore[arg-type]
        route=fake_route(),
        setting=setting,
        seed=seed,
        agent_name="under test",
        **options,  # type: ignore[arg-type]
    )


def by_speed(observation: Observation) -> Control:
    """Depends on what is seen, so that whatever changes the observation changes the drive."""
    return Control(throttle=0.5 + 0.3 * float(np.sin(observation.gps.x_m)), steer=-0.01 * observation.gps.y_m)


def test_a_route_driven_to_its_end_is_completed() -> None:
    result = drive(ScriptedAgent([FULL]))
    assert (result.outcome, result.end) == (Outcome.COMPLETED, End.COMPLETED)
    assert result.route_completion_pct == 100.0
    assert result.ticks == len(result.trace.rows)
    assert result.game_s == pytest.approx(0.05 * result.ticks)
    assert str(result.episode) == "under test on 1 under clean, seed 3"
    assert result.versions == {"fake": "1"}
    assert result.wall_s > 0.0


@pytest.mark.parametrize("end", [End.DEVIATED, End.BLOCKED, End.TICK_CAP, End.STUCK])
def test_any_other_end_of_the_world_is_the_failure_of_the_agent(end: End) -> None:
    result = drive(ScriptedAgent([FULL]), simulator=FakeSimulator(ends=end, ends_at=10))
    assert (result.outcome, result.end, result.ticks) == (Outcome.FAILED, end, 10)


def test_infractions_and_the_share_that_was_driven_come_from_the_world() -> None:
    hit = Infraction(InfractionKind.COLLISION_VEHICLE, 4, "hit car 7 at 4.2 m/s")
    result = drive(ScriptedAgent([FULL]), simulator=FakeSimulator(infractions=(hit,), ends=End.BLOCKED, ends_at=40))
    assert result.infractions == (hit,)
    assert 0.0 < result.route_completion_pct < 100.0
    assert result.route_length_m == 60.0


def test_the_trace_holds_the_ego_after_each_tick_and_the_control_that_led_there() -> None:
    controls = [Control(throttle=0.5), Control(throttle=1.0, steer=0.25), Control(brake=0.75)]
    result = drive(ScriptedAgent(controls), simulator=FakeSimulator(SimulatorOptions(tick_cap=3)))
    assert result.trace.column("throttle").tolist() == [0.5, 1.0, 0.0]
    assert result.trace.column("steer").tolist() == [0.0, 0.25, 0.0]
    assert result.trace.column("brake").tolist() == [0.0, 0.0, 0.75]
    assert result.trace.column("speed_mps")[0] == pytest.approx(0.05 * 1.5)
    assert result.trace.column("x_m")[0] > 0.0


def test_a_long_trace_outgrows_its_first_memory_without_losing_a_row() -> None:
    result = drive(ScriptedAgent([Control(throttle=0.02)]), simulator=FakeSimulator(SimulatorOptions(tick_cap=1300)))
    assert result.trace.rows.shape == (1300, 11)
    assert result.trace.rows.base is None  # a stored trace must not hold the recorder's spare memory
    assert np.isfinite(result.trace.rows).all()
    assert (np.diff(result.trace.column("x_m")) > 0.0).all()


@pytest.mark.parametrize("stored", [False, True])
def test_nobody_can_write_into_what_was_recorded(stored: bool) -> None:
    result = drive(ScriptedAgent([FULL], cameras=[CAMERA]))
    if stored:
        result = decode_episode(encode_episode(result))
    given, tracks = result.given, result.tracks
    assert given is not None
    assert tracks is not None
    of_tracks = (tracks.actors, tracks.motion, tracks.lights, tracks.plans, tracks.points)
    for table in (*result.trace.columns("x_m", "speed_mps"), result.trace.rows, given.rows, *of_tracks):
        with pytest.raises(ValueError, match="read-only"):
            table[:] = 0


def test_the_same_episode_is_the_same_to_the_bit_on_used_and_on_new_objects() -> None:
    setting = Setting.of(GpsNoise(std_m=5.0), InferenceLatency(ms=100))
    simulator, agent = FakeSimulator(), ScriptedAgent(by_speed, cameras=[CAMERA])
    first = drive(agent, simulator=simulator, setting=setting)
    drive(agent, simulator=simulator, setting=setting, seed=4)
    again = drive(agent, simulator=simulator, setting=setting)
    fresh = drive(ScriptedAgent(by_speed, cameras=[CAMERA]), setting=setting)
    assert first.trace.digest == again.trace.digest == fresh.trace.digest
    assert first.trace.digest != drive(agent, simulator=simulator, setting=setting, seed=4).trace.digest


def test_under_the_clean_setting_the_agent_gets_what_the_sensors_gave_and_the_vehicle_what_the_agent_said() -> None:
    agent = RecordingAgent(ScriptedAgent(by_speed, cameras=[CAMERA]))
    result = drive(agent)
    world = FakeSimulator()
    world.reset(fake_route(), seed=3, cameras=[CAMERA])
    for tick, (seen, control) in enumerate(zip(agent.observations, agent.controls, strict=True)):
        given = world.observe()
        assert (seen.tick, seen.gps, seen.speed) == (tick, given.gps, given.speed)
        assert np.array_equal(seen.cameras["front"].pixels, given.cameras["front"].pixels)
        world.step(control)
    assert len(agent.controls) == result.ticks


def test_the_agent_gets_the_plan_and_the_seed_of_the_episode() -> None:
    agent = RecordingAgent(ScriptedAgent([FULL]))
    drive(agent, seed=11)
    assert agent.seed == 11
    assert agent.plan is not None
    assert [point.x_m for point in agent.plan.points] == [0.0, 50.0, 60.0]


def test_an_agent_that_scribbles_on_its_image_changes_no_later_tick() -> None:
    def scribble(observation: Observation) -> Control:
        control = Control(throttle=float(observation.cameras["front"].pixels[0, 0, 0]) / 512.0 + 0.4)
        observation.cameras["front"].pixels[:] = 255
        return control

    def admire(observation: Observation) -> Control:
        return Control(throttle=float(observation.cameras["front"].pixels[0, 0, 0]) / 512.0 + 0.4)

    slow = CameraSpec("front", width_px=16, height_px=9, rate_hz=5.0)
    one, other = drive(ScriptedAgent(scribble, cameras=[slow])), drive(ScriptedAgent(admire, cameras=[slow]))
    assert one.trace.digest == other.trace.digest
    assert one.outcome is Outcome.COMPLETED


def test_an_agent_may_keep_its_observations() -> None:
    kept: list[Observation] = []

    def keep(observation: Observation) -> Control:
        kept.append(observation)
        return FULL

    drive(ScriptedAgent(keep, cameras=[CAMERA]))
    reds = [int(observation.cameras["front"].pixels[0, 0, 0]) for observation in kept]
    assert reds == [int(observation.gps.x_m * 4.0) % 256 for observation in kept]


def test_the_truth_reaches_only_agents_that_ask_for_it() -> None:
    blind, seeing = (RecordingAgent(ScriptedAgent([FULL], privileged=asks)) for asks in (False, True))
    assert drive(blind).privileged is False
    assert drive(seeing).privileged is True
    assert all(observation.truth is None for observation in blind.observations)
    assert all(seen.truth is not None and seen.truth.state.tick == seen.tick for seen in seeing.observations)


def test_a_privileged_agent_cannot_move_the_actors() -> None:
    def push(observation: Observation) -> Control:
        assert observation.truth is not None
        observation.truth.state.actors[:] = 0.0
        return FULL

    simulator = FakeSimulator()
    assert drive(ScriptedAgent(push, privileged=True), simulator=simulator).outcome is Outcome.COMPLETED
    assert simulator.truth().state.actors[0, 0] == 7.0


def test_a_perturbed_observation_reaches_the_agent() -> None:
    agent = RecordingAgent(ScriptedAgent([FULL], cameras=[CAMERA]))
    drive(agent, setting=Setting.of(PartialObservation(ratio=0.5)))
    assert any((seen.cameras["front"].pixels == 0).all(axis=2).any() for seen in agent.observations)


def test_a_fifo_latency_delays_what_the_vehicle_gets() -> None:
    agent = RecordingAgent(ScriptedAgent(by_speed))
    result = drive(agent, setting=Setting.of(InferenceLatency(ms=200)))
    said = [control.throttle for control in agent.controls]
    assert result.trace.column("throttle").tolist() == [0.0] * 4 + said[:-4]


def test_an_agent_whose_computer_is_busy_is_not_asked() -> None:
    agent = RecordingAgent(ScriptedAgent(by_speed))
    result = drive(agent, setting=Setting.of(InferenceLatency(ms=200, mode="hold")))
    assert 0 < len(agent.controls) < result.ticks / 2
    assert result.ticks == len(result.trace.rows)


def test_the_time_of_act_is_kept_when_the_latency_is_measured_and_only_then() -> None:
    agent = RecordingAgent(ScriptedAgent([FULL]))
    measured = drive(agent, setting=Setting.of(InferenceLatency(mode="measured")))
    assert len(measured.inference_s) == len(agent.controls)
    assert all(seconds > 0.0 for seconds in measured.inference_s)
    assert drive(agent, setting=Setting.of(InferenceLatency(ms=100))).inference_s == ()


def test_the_schedule_of_what_was_injected_is_part_of_the_result() -> None:
    result = drive(ScriptedAgent([FULL], cameras=[CAMERA]), setting=Setting.of(PartialObservation(ratio=0.5)))
    assert result.schedule
    assert drive(ScriptedAgent([FULL], cameras=[CAMERA])).schedule == ()


def test_during_the_warm_up_of_the_setting_the_vehicle_gets_the_neutral_control() -> None:
    @dataclass
    class SlowStart(Perturbation):
        warmup_ticks: int = 8
        phrase = "slow start {warmup_ticks}"

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(SlowStart()))
    assert result.trace.column("throttle")[:9].tolist() == [0.0] * 8 + [1.0]


class Told(Watch):
    """Keeps what it is told of every tick."""

    def __init__(self) -> None:
        self.ticks: list[tuple[int, int, int, Control | None, Control]] = []

    def ticked(
        self, tick: int, state: WorldState, observation: Observation, asked: Control | None, applied: Control
    ) -> None:
        self.ticks.append((tick, state.tick, observation.tick, asked, applied))


def test_a_watch_is_shown_the_world_of_the_observation_and_the_control_that_the_vehicle_got() -> None:
    told = Told()
    result = drive(ScriptedAgent([FULL]), watch=told)
    assert told.ticks == [(tick, tick, tick, FULL, FULL) for tick in range(result.ticks)]


def test_a_watch_is_told_when_the_agent_was_not_asked() -> None:
    told = Told()
    drive(ScriptedAgent([FULL]), watch=told, setting=Setting.of(InferenceLatency(ms=200, mode="hold")))
    assert {asked for _, _, _, asked, _ in told.ticks} == {FULL, None}


def test_numbers_of_any_kind_become_plain_floats() -> None:
    agent = ScriptedAgent([Control(throttle=np.float32(0.5), steer=0, brake=np.float64(0.0))])
    told = Told()
    drive(agent, watch=told)
    controls = [applied for *_, applied in told.ticks]
    assert {type(value) for control in controls for value in (control.throttle, control.steer, control.brake)} == {
        float
    }


def test_an_observation_with_truth_from_a_careless_simulator_is_stripped() -> None:
    class Careless(FakeSimulator):
        def observe(self) -> Observation:
            return replace(super().observe(), truth=self.truth())

    agent = RecordingAgent(ScriptedAgent([FULL]))
    drive(agent, simulator=Careless())
    assert all(seen.truth is None for seen in agent.observations)


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
        (crash, r"act raised ZeroDivisionError: division by zero \(.*test_loop\.py:\d+ in crash\)"),
        (lambda: sys.exit("bye"), "act raised SystemExit: bye"),
        (lambda: np.zeros((2, 2)) @ np.zeros((3, 3)), r"act raised ValueError: .*test_loop\.py:\d+"),
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


@pytest.mark.parametrize("method", ["reset", "observe", "wants_inference", "actuate"])
def test_a_perturbation_that_raises_is_blamed_and_neither_the_agent_nor_the_world(method: str) -> None:
    def short(*given: object) -> None:
        raise OSError("short circuit")

    failure = type("Short", (Perturbation,), {method: short})
    result = drive(ScriptedAgent([FULL]), setting=Setting.of(failure()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert result.end_detail.startswith("a perturbation raised OSError: short circuit (")
    assert "test_loop.py" in result.end_detail


def test_a_world_that_raises_under_a_perturbation_is_blamed() -> None:
    simulator = FakeSimulator(raises=OSError("short circuit"), raises_at=25)
    result = drive(
        ScriptedAgent([FULL]), simulator=simulator, setting=Setting.parse("100 ms latency and speed noise 0.5")
    )
    assert result.end_detail.startswith("the simulation raised OSError: short circuit")


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


def test_a_privileged_agent_cannot_change_the_map_of_later_episodes() -> None:
    class Digger(RecordingAgent):
        privileged = True

        def act(self, observation: Observation) -> Control:
            assert observation.truth is not None
            observation.truth.lane_map.lanes[0].centre[:] += 5.0
            return super().act(observation)

    simulator, route = EmbeddedSimulator(), named_routes("dev10")[0]
    simulator.reset(route, seed=0, cameras=())
    before = simulator.truth().lane_map.lanes[0].centre.copy()
    drive_episode(simulator, Digger([FULL]), route=route, setting=Setting.CLEAN, seed=0, agent_name="digger")
    simulator.reset(route, seed=0, cameras=())
    assert np.array_equal(simulator.truth().lane_map.lanes[0].centre, before)


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


def test_a_perturbation_that_gives_the_vehicle_something_else_is_named() -> None:
    class Tuple(Perturbation):
        def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
            return (0.0, 0.0, 0.0)  # type: ignore[return-value]

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Tuple()))
    assert result.end is End.SIMULATION_CRASHED
    assert "the perturbations gave the vehicle (0.0, 0.0, 0.0), expected a Control or None" in result.end_detail


@pytest.mark.parametrize(
    ("pixels", "told"),
    [
        (
            lambda image: image * 0.5,
            r"gave pixels (9, 16, 3) float64 for the camera 'front', expected (9, 16, 3) uint8",
        ),
        (lambda image: image[1:], "gave pixels (8, 16, 3) uint8 for the camera 'front', expected (9, 16, 3) uint8"),
    ],
)
def test_a_perturbation_that_spoils_an_image_is_named_and_not_the_agent(
    pixels: Callable[[Any], Any], told: str
) -> None:
    class Spoiling(Perturbation):
        def observe(self, observation: Observation) -> Observation:
            return observation.map_images(lambda name, image: Image(pixels(image.pixels), image.tick))

    result = drive(ScriptedAgent([FULL], cameras=(CAMERA,)), setting=Setting.of(Spoiling()))
    assert result.end is End.SIMULATION_CRASHED
    assert told in result.end_detail


@pytest.mark.parametrize(
    "before",
    [
        Setting.CLEAN,
        Setting.of(BurstFrameDrop(length_s=1.0, probability=1.0)),
        Setting.of(SensorDelay(camera_ms=100)),
        Setting.of(FrameBlend(frames=2)),
    ],
    ids=str,
)
def test_a_perturbation_that_writes_into_an_image_which_is_given_again_is_told_where(before: Setting) -> None:
    class Dimming(Perturbation):
        def observe(self, observation: Observation) -> Observation:
            if observation.tick == 2:
                observation.cameras["front"].pixels[:] //= 2
            return observation

    slow = CameraSpec("front", width_px=16, height_px=9, rate_hz=5.0)
    result = drive(ScriptedAgent([FULL], cameras=(slow,)), setting=before + Dimming())
    assert (result.end, result.ticks) == (End.SIMULATION_CRASHED, 2)
    assert "ValueError: output array is read-only (" in result.end_detail
    assert "test_loop.py:" in result.end_detail


@pytest.mark.parametrize("setting", ["100 ms sensor delay", "clean"])
def test_an_agent_may_write_to_what_it_gets_under_any_setting(setting: str) -> None:
    def scribble(observation: Observation) -> Control:
        observation.cameras["front"].pixels[:] = 255
        return FULL

    result = drive(ScriptedAgent(scribble, cameras=(CAMERA,)), setting=Setting.parse(setting))
    assert result.outcome is Outcome.COMPLETED


def test_a_perturbation_that_loses_a_camera_is_named() -> None:
    class Losing(Perturbation):
        def observe(self, observation: Observation) -> Observation:
            return replace(observation, cameras={})

    result = drive(ScriptedAgent([FULL], cameras=(CAMERA,)), setting=Setting.of(Losing()))
    assert result.end is End.SIMULATION_CRASHED
    assert "Losing.observe gave images of [], expected those of ['front']" in result.end_detail


def test_an_observation_of_another_tick_is_blamed_on_the_perturbation_that_kept_it() -> None:
    class Late(Perturbation):
        def reset(self, context: EpisodeContext) -> None:
            self.kept: list[Observation] = []

        def observe(self, observation: Observation) -> Observation:
            self.kept.append(observation)
            return self.kept[max(observation.tick - 5, 0)]

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Late()))
    assert (result.end, result.ticks) == (End.SIMULATION_CRASHED, 1)
    assert "Late.observe gave the observation of tick 0 in tick 1: give the signals" in result.end_detail


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda seen: replace(seen, gps=replace(seen.gps, x_m=float("nan"))), "gps.x_m is nan, expected a finite"),
        (lambda seen: replace(seen, speed=replace(seen.speed, mps="fast")), "speed.mps is 'fast', expected a finite"),
        (lambda seen: replace(seen, imu=None), "imu is None, expected a Imu"),
    ],
)
def test_a_signal_that_is_none_is_blamed_on_the_perturbation_or_the_world_that_gave_it(
    change: Callable[[Observation], Any], told: str
) -> None:
    class Losing(Perturbation):
        def observe(self, observation: Observation) -> Observation:
            return change(observation) if observation.tick >= 20 else observation

    class Lost(FakeSimulator):
        def observe(self) -> Observation:
            return change(super().observe()) if self._tick >= 20 else super().observe()

    perturbed = drive(ScriptedAgent(by_speed), setting=Setting.of(Losing()))
    assert (perturbed.end, perturbed.ticks) == (End.SIMULATION_CRASHED, 20)
    assert f"Losing.observe gave an observation whose {told}" in perturbed.end_detail
    result = drive(ScriptedAgent(by_speed), simulator=Lost())
    assert (result.end, result.ticks) == (End.SIMULATION_CRASHED, 20)
    assert f"observe() gave an observation whose {told}" in result.end_detail


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda seen: replace(seen, cameras={}), "observe() gave images of [], expected those of ['front']"),
        (
            lambda seen: replace(seen, cameras={**seen.cameras, "ghost": seen.cameras["front"]}),
            "observe() gave images of ['front', 'ghost'], expected those of ['front']",
        ),
        (
            lambda seen: seen.map_images(lambda name, image: Image(image.pixels[:4] / 1.0, image.tick)),
            "observe() gave an image of another kind: front is (4, 16, 3) float64, expected (9, 16, 3) uint8",
        ),
        (
            lambda seen: seen.map_images(lambda name, image: image.pixels),
            "observe() gave an image of another kind: front is a ndarray, expected an Image",
        ),
        (lambda seen: None, "observe() gave None, expected an Observation"),
    ],
)
def test_images_that_the_world_does_not_give_are_not_blamed_on_the_agent(
    change: Callable[[Observation], Any], told: str
) -> None:
    class Blind(FakeSimulator):
        def observe(self) -> Observation:
            return change(super().observe()) if self._tick >= 20 else super().observe()

    result = drive(ScriptedAgent([FULL], cameras=(CAMERA,)), simulator=Blind())
    assert (result.end, result.ticks, result.end_detail) == (End.SIMULATION_CRASHED, 20, told)


@pytest.mark.parametrize(
    ("change", "ticks", "told"),
    [
        (
            {"done": property(lambda world: False)},
            0,
            "done is False, expected an End, and None while the episode goes on",
        ),
        (
            {"done": property(lambda world: True if world._tick > 20 else None)},
            21,
            "done is True, expected an End, and None while the episode goes on",
        ),
        ({"step": lambda world, control: None}, 0, "step() gave None, expected a WorldState"),
        ({"reset": lambda world, route, seed, cameras: None}, 0, "reset() gave None, expected a WorldState"),
        ({"dt_s": 0.0}, 0, "dt_s is 0.0, expected the seconds of a tick, above 0"),
        ({"dt_s": math.nan}, 0, "dt_s is nan, expected the seconds of a tick, above 0"),
    ],
)
def test_an_answer_of_the_world_that_says_nothing_is_no_score_of_the_agent(
    change: dict[str, object], ticks: int, told: str
) -> None:
    world = type("Odd", (FakeSimulator,), change)
    result = drive(ScriptedAgent([FULL]), simulator=world())
    assert (result.outcome, result.ticks, result.end_detail) == (Outcome.INFRA_ERROR, ticks, told)


@pytest.mark.parametrize("name", ["x_m", "speed_mps", "forward_mps2"])
def test_an_ego_whose_motion_is_no_number_is_not_scored(name: str) -> None:
    class Lost(FakeSimulator):
        def step(self, control: Control) -> WorldState:
            state = super().step(control)
            return replace(state, ego=replace(state.ego, **{name: math.nan})) if self._tick == 31 else state

    result = drive(ScriptedAgent([FULL]), simulator=Lost())
    assert (result.outcome, result.route_completion_pct) == (Outcome.INFRA_ERROR, 0.0)
    assert result.end_detail == f"the world's {name} is nan after 31 ticks, expected a finite number"


def test_what_was_injected_is_checked_before_it_is_stored() -> None:
    class Noting(Perturbation):
        def schedule(self) -> Any:
            return [{"signal": "gps"}]

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Noting()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert "schedule() of a perturbation gave {'signal': 'gps'}, expected Injection objects" in result.end_detail


@pytest.mark.parametrize(
    ("score", "told"),
    [
        (lambda score: {}, "score() gave {}, expected an EpisodeScore"),
        (lambda score: None, "score() gave None, expected an EpisodeScore"),
        (lambda score: replace(score, end="completed"), "score() gave the end 'completed', expected an End"),
        (lambda score: replace(score, infractions=["hit"]), "score() gave the infraction 'hit', expected Infraction"),
        (
            lambda score: replace(score, end_detail=b"at the end"),
            "stored, end_detail: expected text, got bytes",
        ),
        (
            lambda score: replace(score, route_completion_pct=101.0),
            "stored, route_completion_pct: expected a finite number in 0..100, got 101.0",
        ),
        (lambda score: replace(score, route_length_m=math.nan), "cannot be stored, route_length_m: expected a finite"),
        (
            lambda score: replace(score, speed_ratios_pct=[None]),
            "stored, speed_ratios_pct: expected a finite",
        ),
        (
            lambda score: replace(score, speed_ratios_pct=[90.0, -1.0]),
            "stored, speed_ratios_pct: expected a finite number of 0 or more, got -1.0",
        ),
        (
            lambda score: replace(
                score, infractions=[Infraction(InfractionKind.OUTSIDE_LANES, 1, "", share_pct=101.0)]
            ),
            "score() gave outside_route_lanes with share_pct 101.0, expected 0..100",
        ),
        (lambda score: replace(score, junction_passed="yes"), "cannot be stored, junction_passed: expected true or"),
        (
            lambda score: replace(score, infractions=[Infraction(InfractionKind.RED_LIGHT, 1.5, "")]),
            "cannot be stored, infractions: tick: expected a whole number",
        ),
    ],
)
def test_a_score_is_checked_before_it_is_stored(score: Callable[[Any], Any], told: str) -> None:
    class Scoring(FakeSimulator):
        def score(self) -> Any:
            return score(super().score())

    result = drive(ScriptedAgent([FULL]), simulator=Scoring())
    assert result.outcome is Outcome.INFRA_ERROR
    assert told in result.end_detail


@pytest.mark.parametrize("share_pct", [12.5, np.float32(12.5), np.float64(12.5), 12])
def test_what_a_score_may_hold_is_stored_as_it_is(share_pct: Any) -> None:
    event = Infraction(InfractionKind.OUTSIDE_LANES, int(share_pct), "", x_m=np.float32(-3.0), share_pct=share_pct)

    class Scoring(FakeSimulator):
        def score(self) -> Any:
            return replace(super().score(), infractions=[event], junction_passed=np.bool_(True))

    result = drive(ScriptedAgent([FULL]), simulator=Scoring())
    assert result.outcome is Outcome.COMPLETED
    assert decode_episode(encode_episode(result)).infractions == (event,)


def test_what_was_injected_is_named_where_it_cannot_be_stored() -> None:
    class Noting(Perturbation):
        def schedule(self) -> Any:
            return (Injection("noting", "gps", 0, 1.5),)  # type: ignore[arg-type]

    result = drive(ScriptedAgent([FULL]), setting=Setting.of(Noting()))
    assert result.outcome is Outcome.INFRA_ERROR
    assert "cannot be stored, schedule: last_tick: expected a whole number" in result.end_detail


def test_versions_are_kept_as_text() -> None:
    class Numbered(FakeSimulator):
        def versions(self) -> Any:
            return {"carla": 15}

    assert drive(ScriptedAgent([FULL]), simulator=Numbered()).versions == {"carla": "15"}
