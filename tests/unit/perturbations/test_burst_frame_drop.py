from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stream_factory import flat_pixels, observation_at, observed, started

from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations import BurstFrameDrop, Setting
from pytest_drive_robust.perturbations.burst_frame_drop import BurstSchedule
from pytest_drive_robust.perturbations.context import Draws


def stale_ticks(driven: list[Observation], camera: str = "front") -> list[int]:
    return [seen.tick for seen in driven if seen.cameras[camera].tick != seen.tick]


def test_a_burst_repeats_the_last_valid_frame_with_its_tick_and_pixels() -> None:
    driven = observed(BurstFrameDrop(length_s=1.0, probability=0.05), range(400))
    assert stale_ticks(driven)
    valid = 0
    for seen in driven:
        image = seen.cameras["front"]
        valid = seen.tick if image.tick == seen.tick else valid
        assert image.tick == valid
        assert np.array_equal(image.pixels, flat_pixels(valid))


def test_a_burst_repeats_what_was_shown_although_the_simulator_reuses_its_pixels() -> None:
    stack = started(BurstFrameDrop(length_s=1.0, probability=1.0))
    buffer = np.zeros((6, 8, 3), dtype=np.uint8)
    for tick in range(5):
        buffer[...] = 40 + tick
        seen = stack.observe(observation_at(tick, pixels=buffer))
        assert np.all(seen.cameras["front"].pixels == 40)


def test_the_first_frame_of_an_episode_is_delivered_and_starts_no_burst() -> None:
    driven = observed(BurstFrameDrop(length_s=3.0, probability=1.0), range(100))
    assert driven[0].cameras["front"].tick == 0
    assert stale_ticks(driven) == list(range(1, 100))


def test_the_record_of_the_last_burst_ends_with_the_episode() -> None:
    stack = started(BurstFrameDrop(length_s=3.0, probability=1.0))
    for tick in range(100):
        stack.observe(observation_at(tick))
    assert [(item.first_tick, item.last_tick) for item in stack.schedule()] == [(1, 60), (61, 99)]


def test_a_burst_that_begins_with_the_last_tick_is_recorded() -> None:
    schedule = BurstSchedule(Draws(1, "r", "s"), "front", probability=1.0, longest_ticks=3, uniform=False)
    assert schedule.until(4) == [(1, 3), (4, 4)]


def test_an_episode_that_is_looked_at_late_has_no_earlier_frame_to_repeat() -> None:
    driven = observed(BurstFrameDrop(length_s=3.0, probability=1.0), [30, 31])
    assert [seen.cameras["front"].tick for seen in driven] == [30, 30]


def test_the_tick_that_triggers_is_stale_and_a_fixed_burst_has_its_length() -> None:
    stack = started(BurstFrameDrop(length_s=1.0, probability=0.01), seed=3)
    driven = [stack.observe(observation_at(tick)) for tick in range(3000)]
    spans = [(item.first_tick, item.last_tick) for item in stack.schedule()]
    assert [tick for first, last in spans for tick in range(first, last + 1)] == stale_ticks(driven)
    assert {last - first + 1 for first, last in spans[:-1]} == {20}
    draws = Draws(3, "2091", "burst-frame-drop")
    for first, _ in spans:
        assert draws.uniform("camera 0", first)[0] < 0.01


@settings(max_examples=25)
@given(st.integers(0, 99), st.lists(st.integers(0, 500), min_size=1, unique=True))
def test_which_ticks_are_frozen_does_not_depend_on_which_are_looked_at(seed: int, looked_at: list[int]) -> None:
    def schedule() -> BurstSchedule:
        return BurstSchedule(Draws(seed, "r", "s"), "front", probability=0.05, longest_ticks=7, uniform=True)

    in_order = schedule()
    truth = [in_order.is_frozen(tick) for tick in range(501)]
    other = schedule()
    assert [other.is_frozen(tick) for tick in looked_at] == [truth[tick] for tick in looked_at]


def test_cameras_freeze_independently_of_each_other_and_of_their_names() -> None:
    perturbation = BurstFrameDrop(length_s=0.2, probability=0.05)
    both = observed(perturbation, range(800), cameras=("front", "rear"))
    alone = observed(perturbation, range(800), cameras=("CAM_FRONT",))
    front, rear = (set(stale_ticks(both, camera)) for camera in ("front", "rear"))
    assert front == set(stale_ticks(alone, "CAM_FRONT"))
    share = len(front & rear) / 800
    assert share == pytest.approx(len(front) * len(rear) / 800**2, abs=0.03)


def test_bursts_start_as_often_as_the_probability_says() -> None:
    schedule = BurstSchedule(Draws(1, "r", "s"), "front", probability=0.02, longest_ticks=5, uniform=False)
    bursts = schedule.until(100_000)
    free = 100_000 - 5 * len(bursts)
    assert len(bursts) / (free + len(bursts)) == pytest.approx(0.02, abs=0.0019)  # 4 standard errors


def test_uniform_bursts_last_two_ticks_up_to_the_longest_with_equal_chances() -> None:
    schedule = BurstSchedule(Draws(1, "r", "s"), "front", probability=0.5, longest_ticks=6, uniform=True)
    lengths = [last - first + 1 for first, last in schedule.until(50_000)][:-1]
    assert set(lengths) == {2, 3, 4, 5, 6}
    counts = np.bincount(lengths)[2:] / len(lengths)
    assert counts == pytest.approx([0.2] * 5, abs=0.02)


def test_the_released_reading_reaches_uniform_lengths_through_the_setting() -> None:
    stack = started(BurstFrameDrop(length_s=0.3, probability=0.3, length="uniform"))
    for tick in range(2000):
        stack.observe(observation_at(tick))
    lengths = {item.last_tick - item.first_tick + 1 for item in stack.schedule()[:-1]}
    assert lengths == {2, 3, 4, 5, 6}


def test_zero_probability_never_freezes() -> None:
    assert stale_ticks(observed(BurstFrameDrop(probability=0.0), range(500))) == []


def test_a_slow_camera_that_repeats_itself_keeps_the_tick_of_its_capture() -> None:
    stack = started(BurstFrameDrop(probability=0.0))
    slow = Image(flat_pixels(1), 4)
    seen = stack.observe(observation_at(6).map_images(lambda *_: slow))
    assert seen.cameras["front"].tick == 4


def test_a_burst_of_a_slow_camera_repeats_the_tick_of_its_capture() -> None:
    stack = started(BurstFrameDrop(probability=1.0))
    slow = Image(flat_pixels(1), 4)
    seen = [stack.observe(observation_at(tick).map_images(lambda *_: slow)) for tick in (6, 7, 8)]
    assert [one.cameras["front"].tick for one in seen] == [4, 4, 4]


@pytest.mark.parametrize(("length", "length_s", "ticks"), [("fixed", 0.05, 1), ("uniform", 0.1, 2)])
def test_the_shortest_burst_that_the_simulator_can_show_is_driven(length: str, length_s: float, ticks: int) -> None:
    stack = started(BurstFrameDrop(length_s=length_s, probability=0.2, length=length))  # type: ignore[arg-type]
    for tick in range(100):
        stack.observe(observation_at(tick))
    assert {item.last_tick - item.first_tick + 1 for item in stack.schedule()[:-1]} == {ticks}


def test_a_mask_on_top_is_drawn_anew_on_the_stale_image() -> None:
    setting = Setting.parse("3 s burst frame drop (probability=1) and occlusion 0.5")
    driven = observed(setting, range(1, 8))
    assert len({seen.cameras["front"].pixels.tobytes() for seen in driven}) > 1
    assert {seen.cameras["front"].tick for seen in driven} == {1}


@pytest.mark.parametrize(("length", "dt_s"), [("fixed", 2.0), ("uniform", 0.6)])
def test_a_burst_shorter_than_the_simulator_can_show_is_refused(length: str, dt_s: float) -> None:
    with pytest.raises(PerturbationError, match=r"length_s is 1\.0, expected at least .* a tick lasts"):
        started(Setting.parse(f"1 s burst frame drop (length={length})"), dt_s=dt_s)


def test_lengths_of_whole_ticks_survive_rounding() -> None:
    stack = started(BurstFrameDrop(length_s=0.15, probability=0.01), dt_s=0.05)
    assert 0.15 / 0.05 < 3.0
    for tick in range(1000):
        stack.observe(observation_at(tick))
    assert {item.last_tick - item.first_tick + 1 for item in stack.schedule()[:-1]} == {3}
