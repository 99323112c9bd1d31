"""What a world does wrong is blamed on it and never scored."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from episode_loop import CAMERA, FULL, drive

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent


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


def test_a_world_that_raises_under_a_perturbation_is_blamed() -> None:
    simulator = FakeSimulator(raises=OSError("short circuit"), raises_at=25)
    result = drive(
        ScriptedAgent([FULL]), simulator=simulator, setting=Setting.parse("100 ms latency and speed noise 0.5")
    )
    assert result.end_detail.startswith("the simulation raised OSError: short circuit")


def test_a_simulator_that_leaves_by_sys_exit_is_not_an_agent_error() -> None:
    class Leaving(FakeSimulator):
        def plan(self) -> GlobalPlan:
            sys.exit(9)

    with pytest.raises(SystemExit):
        drive(ScriptedAgent([FULL]), simulator=Leaving())


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
    assert decode_episode(encode_episode(result)).end_detail == told


@pytest.mark.parametrize("name", ["x_m", "speed_mps", "forward_mps2"])
def test_an_ego_whose_motion_is_no_number_is_not_scored(name: str) -> None:
    class Lost(FakeSimulator):
        def step(self, control: Control) -> WorldState:
            state = super().step(control)
            return replace(state, ego=replace(state.ego, **{name: math.nan})) if self._tick == 31 else state

    result = drive(ScriptedAgent([FULL]), simulator=Lost())
    assert (result.outcome, result.route_completion_pct) == (Outcome.INFRA_ERROR, 0.0)
    assert result.end_detail == f"the world's {name} is nan after 31 ticks, expected a finite number"


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
