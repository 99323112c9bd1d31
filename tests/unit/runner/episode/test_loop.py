"""The closed loop with a tiny world: what the agent gets, what the vehicle gets, what is recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from episode_loop import CAMERA, FULL, by_speed, drive

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.perturbations import GpsNoise, InferenceLatency, PartialObservation, Perturbation, Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.testing import FakeSimulator, RecordingAgent, ScriptedAgent, fake_route


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


@pytest.mark.parametrize("setting", ["100 ms sensor delay", "clean"])
def test_an_agent_may_write_to_what_it_gets_under_any_setting(setting: str) -> None:
    def scribble(observation: Observation) -> Control:
        observation.cameras["front"].pixels[:] = 255
        return FULL

    result = drive(ScriptedAgent(scribble, cameras=(CAMERA,)), setting=Setting.parse(setting))
    assert result.outcome is Outcome.COMPLETED


def test_versions_are_kept_as_text() -> None:
    class Numbered(FakeSimulator):
        def versions(self) -> Any:
            return {"carla": 15}

    assert drive(ScriptedAgent([FULL]), simulator=Numbered()).versions == {"carla": "15"}
