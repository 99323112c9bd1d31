"""check_simulator finds each kind of broken promise, and the fake keeps them all."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption, Route
from pytest_drive_robust.domain.truth import EgoState, GroundTruth, WorldState
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.testing import ContractReport, FakeSimulator, check_simulator


def failed(report: ContractReport) -> list[str]:
    assert not report.ok
    return [check.name for check in report.checks if not check.ok]


def test_the_fake_keeps_the_contract() -> None:
    report = check_simulator(FakeSimulator)
    assert report.ok, str(report)
    names = [check.name for check in report.checks]
    assert names == [
        "members",
        "end",
        "plan",
        "versions",
        "stamps",
        "truth",
        "states",
        "stuck",
        "determinism",
        "reset",
        "isolation",
        "globals",
        "close",
    ]


def test_the_embedded_world_keeps_the_contract() -> None:
    report = check_simulator(EmbeddedSimulator, route=named_routes("dev10")[0])
    assert report.ok, str(report)
    assert report["stuck"].sentence == "the episode ends once the ego stood for 1 s."


@pytest.mark.parametrize("rate_hz", [10, 20, 25, 30])
def test_a_world_of_any_rate_is_driven(rate_hz: int) -> None:
    def made(options: SimulatorOptions) -> FakeSimulator:
        world = FakeSimulator(options)
        world.dt_s = 1.0 / rate_hz
        return world

    report = check_simulator(made)
    assert report.ok, str(report)
    assert "ends after " in report["end"].sentence
    assert "after 0 ticks" not in report["end"].sentence


@pytest.mark.parametrize("dt_s", [0.0, None])
def test_a_tick_without_length_is_found(dt_s: float) -> None:
    class Timeless(FakeSimulator):
        def __init__(self, options: SimulatorOptions) -> None:
            super().__init__(options)
            self.dt_s = dt_s

    report = check_simulator(Timeless)
    assert failed(report) == ["members"]
    assert f"dt_s is {dt_s!r}, expected the seconds of a tick" in report["members"].sentence


def test_missing_members_are_named() -> None:
    class Half:
        name = "half"

    report = check_simulator(lambda options: Half())  # type: ignore[arg-type, return-value]
    assert failed(report) == ["members"]
    assert "close, done, dt_s" in report["members"].sentence


def test_a_world_that_breaks_is_told() -> None:
    report = check_simulator(lambda options: FakeSimulator(options, raises=OSError("gone"), raises_at=9))
    assert failed(report) == ["end"]
    assert "tick 9" in report["end"].sentence


def test_a_wrong_share_of_the_route_is_found() -> None:
    class Generous(FakeSimulator):
        def score(self) -> EpisodeScore:
            return replace(super().score(), route_completion_pct=140.0)

    assert failed(check_simulator(Generous)) == ["end"]


def test_a_late_stamp_is_found() -> None:
    class Late(FakeSimulator):
        def observe(self) -> Observation:
            seen = super().observe()
            return replace(seen, speed=replace(seen.speed, tick=seen.tick - 1))

    assert failed(check_simulator(Late)) == ["stamps"]


def test_a_camera_that_ignores_its_rate_is_found() -> None:
    class Eager(FakeSimulator):
        def observe(self) -> Observation:
            seen = super().observe()
            return seen.map_images(lambda name, image: replace(image, tick=seen.tick))

    report = check_simulator(Eager)
    assert failed(report) == ["stamps"]
    assert "rear at 10 Hz" in report["stamps"].sentence


def test_an_image_of_another_size_in_a_later_tick_is_found() -> None:
    class Cropped(FakeSimulator):
        def observe(self) -> Observation:
            seen = super().observe()
            return seen if seen.tick < 4 else seen.map_images(lambda name, image: Image(image.pixels[1:], image.tick))

    report = check_simulator(Cropped)
    assert failed(report) == ["end"]
    assert "tick 4: observe() gave an image of another kind: front is (17, 32, 3) uint8" in report["end"].sentence


@pytest.mark.parametrize(
    ("cameras", "told"),
    [
        (lambda seen: {}, "tick 0: observe() gave images of [], expected those of ['front', 'rear']."),
        (
            lambda seen: {**seen.cameras, "ghost": seen.cameras["front"]},
            "tick 0: observe() gave images of ['front', 'ghost', 'rear'], expected those of ['front', 'rear'].",
        ),
        (
            lambda seen: {name: Image(image.pixels.tolist(), image.tick) for name, image in seen.cameras.items()},
            "tick 0: observe() gave an image of another kind: the pixels of front are a list, expected an array.",
        ),
    ],
)
def test_what_is_no_image_is_found(cameras: Callable[[Observation], dict[str, Image]], told: str) -> None:
    class Blind(FakeSimulator):
        def observe(self) -> Observation:
            seen = super().observe()
            return replace(seen, cameras=cameras(seen))

    report = check_simulator(Blind)
    assert failed(report) == ["end"]
    assert report["end"].sentence == told


def test_a_truth_that_is_none_is_found() -> None:
    class Untrue(FakeSimulator):
        def truth(self) -> GroundTruth:
            return None  # type: ignore[return-value]

    report = check_simulator(Untrue)
    assert failed(report) == ["truth"]
    assert report["truth"].sentence == "truth gave None, expected a GroundTruth."


@pytest.mark.parametrize("method", ["reset", "observe", "step", "score", "truth", "plan", "versions", "close"])
def test_a_world_that_exits_is_told(method: str) -> None:
    def leave(self: FakeSimulator, *arguments: object, **options: object) -> None:
        sys.exit("no server")

    report = check_simulator(type("Exits", (FakeSimulator,), {method: leave}))
    assert "SystemExit: no server" in str(report)
    assert not report.ok


def test_truth_in_the_observation_is_found() -> None:
    class Open(FakeSimulator):
        def observe(self) -> Observation:
            return replace(super().observe(), truth=self.truth())

    assert failed(check_simulator(Open)) == ["truth"]


def test_frames_that_do_not_count_are_found() -> None:
    class Frozen(FakeSimulator):
        def step(self, control: Control) -> WorldState:
            return replace(super().step(control), tick=0)

    assert failed(check_simulator(Frozen)) == ["truth"]


def test_a_world_that_is_different_every_time_is_found() -> None:
    source = itertools.count()

    class Windy(FakeSimulator):
        def step(self, control: Control) -> WorldState:
            return super().step(replace(control, throttle=(next(source) % 101) / 101.0))

    report = check_simulator(Windy)
    assert failed(report) == ["determinism"]
    assert not {"reset", "isolation"} & {check.name for check in report.checks}


def test_a_plan_that_is_different_every_time_is_found() -> None:
    source = itertools.count()

    class Wayward(FakeSimulator):
        def plan(self) -> GlobalPlan:
            return GlobalPlan((*super().plan().points, PlanPoint(float(next(source)), 0.0, RoadOption.LANE_FOLLOW)))

    report = check_simulator(Wayward)
    assert failed(report) == ["determinism"]
    assert "has another plan" in report["determinism"].sentence


POINT = PlanPoint(0.0, 0.0, RoadOption.LANE_FOLLOW)


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        (None, "plan gave None, expected a GlobalPlan."),
        (GlobalPlan(()), "plan gave no points, expected those of the route."),
        (GlobalPlan(((0.0, 0.0),)), "plan gave (0.0, 0.0), expected a PlanPoint with finite x_m and y_m."),  # type: ignore[arg-type]
        (GlobalPlan((POINT, replace(POINT, x_m=math.nan))), "plan gave PlanPoint(x_m=nan, "),
        (GlobalPlan((POINT,), dense=(replace(POINT, command=4),)), "plan gave the command 4, expected a RoadOption."),  # type: ignore[arg-type]
    ],
)
def test_a_plan_that_no_agent_can_follow_is_found(plan: GlobalPlan, told: str) -> None:
    class Lost(FakeSimulator):
        def plan(self) -> GlobalPlan:
            return plan

    report = check_simulator(Lost)
    assert failed(report) == ["plan"]
    assert told in report["plan"].sentence


def test_a_world_that_is_scored_otherwise_than_it_ended_is_found() -> None:
    class Flattering(FakeSimulator):
        def score(self) -> EpisodeScore:
            return replace(super().score(), end=End.COMPLETED)

    report = check_simulator(Flattering)
    assert failed(report) == ["end", "stuck"]
    assert "done is <End.TICK_CAP: " in report["end"].sentence
    assert "score() has the end <End.COMPLETED: " in report["end"].sentence


def test_a_speed_that_is_left_of_the_last_episode_is_found() -> None:
    class Rolling(FakeSimulator):
        def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
            before = getattr(self, "_ego", None)
            super().reset(route, seed=seed, cameras=cameras)
            if before is not None:
                self._ego = replace(self._ego, speed_mps=before.speed_mps)
            return self._state()

    report = check_simulator(Rolling)
    assert failed(report) == ["reset"]
    assert "looks different in tick 0" in report["reset"].sentence


def test_infractions_that_are_left_of_the_last_episode_are_found() -> None:
    class Resentful(FakeSimulator):
        def score(self) -> EpisodeScore:
            self.infractions = (*self.infractions, Infraction(InfractionKind.COLLISION_VEHICLE, 3, "a car", 0.0, 0.0))
            return super().score()

    report = check_simulator(Resentful)
    assert failed(report) == ["reset"]
    assert "has another score: infractions" in report["reset"].sentence


def test_a_world_that_draws_from_a_global_generator_is_found() -> None:
    class Gusty(FakeSimulator):
        def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
            np.random.seed(seed)
            return super().reset(route, seed=seed, cameras=cameras)

        def step(self, control: Control) -> WorldState:
            return super().step(replace(control, throttle=control.throttle * np.random.random()))

    report = check_simulator(Gusty)
    assert failed(report) == ["globals"]
    assert "what is seen in tick 1: draw from a generator of the object" in report["globals"].sentence


def test_worlds_that_share_what_an_episode_changes_are_found() -> None:
    class Siblings(FakeSimulator):
        egos: ClassVar[list[EgoState]] = []

        def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
            state = super().reset(route, seed=seed, cameras=cameras)
            self.egos[:] = [state.ego]
            return state

        def step(self, control: Control) -> WorldState:
            self._ego = self.egos[0]
            state = super().step(control)
            self.egos[:] = [state.ego]
            return state

    assert failed(check_simulator(Siblings)) == ["globals"]


@pytest.mark.parametrize(
    ("done", "told"),
    [
        (False, "tick 0: done is False, expected an End"),
        (End.COMPLETED, "the episode is over after 0 ticks"),
        ("finished", "done is 'finished', expected an End"),
    ],
)
def test_an_episode_in_which_nothing_is_driven_is_found(done: object, told: str) -> None:
    class Idle(FakeSimulator):
        @property
        def done(self) -> End | None:
            return done  # type: ignore[return-value]

        def score(self) -> EpisodeScore:
            return EpisodeScore(End.COMPLETED, "", 0.0, 60.0, (), (), junction_passed=False)

    report = check_simulator(Idle)
    assert failed(report) == ["end"]
    assert told in report["end"].sentence
    assert report.checks[-1].name == "end"


@pytest.mark.parametrize(
    ("versions", "told"), [({"world": 15}, "versions has 'world': 15"), ({3: "1"}, "versions has 3: '1'")]
)
def test_versions_that_are_no_text_are_found(versions: dict[str, str], told: str) -> None:
    class Numbered(FakeSimulator):
        def versions(self) -> dict[str, str]:
            return versions

    report = check_simulator(Numbered)
    assert failed(report) == ["versions"]
    assert told in report["versions"].sentence


def test_closing_twice_must_do_no_harm() -> None:
    class Once(FakeSimulator):
        closed = False

        def close(self) -> None:
            if self.closed:
                raise ValueError("already closed")
            self.closed = True

    assert failed(check_simulator(Once)) == ["close"]


def test_an_episode_that_does_not_end_under_the_cap_is_found() -> None:
    report = check_simulator(lambda options: FakeSimulator(replace(options, tick_cap=options.tick_cap + 5)))
    assert failed(report) == ["end"]
    assert "65 ticks under a tick_cap of 60" in report["end"].sentence


def test_a_progress_that_is_no_number_in_one_tick_is_found() -> None:
    class Lost(FakeSimulator):
        @property
        def progress_m(self) -> float:
            return math.nan if self._tick == 3 else super().progress_m

    report = check_simulator(Lost)
    assert failed(report) == ["end"]
    assert "progress_m is nan after 3 ticks, expected a finite number." in report["end"].sentence


def test_a_table_of_actors_that_a_later_tick_writes_to_is_found() -> None:
    class Reusing(FakeSimulator):
        def step(self, control: Control) -> WorldState:
            self._actors[0, WorldState.X] += 0.1
            return super().step(control)

    report = check_simulator(Reusing)
    assert failed(report) == ["states"]
    assert "actors of the state of tick 0 are others after later ticks" in report["states"].sentence


def test_a_world_that_waits_for_an_ego_that_stands_is_found() -> None:
    report = check_simulator(lambda options: FakeSimulator(replace(options, stuck_stop_s=None)))
    assert failed(report) == ["stuck"]
    told = "the ego stood for 10 s under a stuck_stop_s of 1, and the end is "
    assert told in report["stuck"].sentence


def test_an_ego_that_cannot_stand_says_nothing_of_the_option() -> None:
    class Rolling(FakeSimulator):
        def step(self, control: Control) -> WorldState:
            return super().step(replace(control, brake=0.0, throttle=0.5))

    report = check_simulator(lambda options: Rolling(replace(options, stuck_stop_s=None)))
    assert report.ok, str(report)
    assert report["stuck"].sentence.startswith("not tried")


@pytest.mark.parametrize("seed", [0, 7])
def test_the_parked_car_of_the_fake_is_drawn_by_the_seed(seed: int) -> None:
    from pytest_drive_robust.testing import fake_route

    def place(seed: int) -> float:
        return float(FakeSimulator().reset(fake_route(), seed=seed, cameras=[]).actors[0, WorldState.X])

    assert place(seed) == place(seed)
    assert place(seed) != place(seed + 1)
