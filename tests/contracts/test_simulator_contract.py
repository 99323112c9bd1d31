"""check_simulator finds each kind of broken promise, and the fake keeps them all."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions
from pytest_drive_robust.testing import ContractReport, FakeSimulator, check_simulator


def failed(report: ContractReport) -> list[str]:
    assert not report.ok
    return [check.name for check in report.checks if not check.ok]


def test_the_fake_keeps_the_contract() -> None:
    report = check_simulator(FakeSimulator)
    assert report.ok, str(report)
    names = [check.name for check in report.checks]
    assert names == ["members", "end", "stamps", "images", "truth", "isolation", "determinism", "close"]


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


def test_an_image_of_another_size_is_found() -> None:
    class Cropped(FakeSimulator):
        def observe(self) -> Observation:
            return super().observe().map_images(lambda name, image: replace(image, pixels=image.pixels[1:]))

    assert failed(check_simulator(Cropped)) == ["images"]


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

    assert {"determinism", "isolation"} <= set(failed(check_simulator(Windy)))


def test_closing_twice_must_do_no_harm() -> None:
    class Once(FakeSimulator):
        closed = False

        def close(self) -> None:
            if self.closed:
                raise ValueError("already closed")
            self.closed = True

    assert failed(check_simulator(Once)) == ["close"]


def test_an_episode_that_does_not_end_under_the_cap_is_found() -> None:
    report = check_simulator(lambda options: FakeSimulator(SimulatorOptions(tick_cap=options.tick_cap + 5)))
    assert failed(report) == ["end"]
    assert "65 ticks under a tick_cap of 60" in report["end"].sentence


@pytest.mark.parametrize("seed", [0, 7])
def test_the_parked_car_of_the_fake_is_drawn_by_the_seed(seed: int) -> None:
    from pytest_drive_robust.testing import fake_route

    def place(seed: int) -> float:
        return float(FakeSimulator().reset(fake_route(), seed=seed, cameras=[]).actors[0, WorldState.X])

    assert place(seed) == place(seed)
    assert place(seed) != place(seed + 1)
