from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stream_factory import flat_pixels, observation_at, observed, started

from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations import SensorDelay
from pytest_drive_robust.perturbations.ladder import ladder_of


@given(st.integers(0, 12), st.integers(0, 12))
def test_each_group_is_as_old_as_its_delay_and_the_oldest_capture_comes_first(camera: int, ego: int) -> None:
    for seen in observed(SensorDelay(camera_ms=50.0 * camera, ego_ms=50.0 * ego), range(30)):
        captured = max(0, seen.tick - camera)
        assert seen.cameras["front"].tick == captured
        assert np.array_equal(seen.cameras["front"].pixels, flat_pixels(captured))
        source = observation_at(max(0, seen.tick - ego))
        assert (seen.gps, seen.compass, seen.imu, seen.speed) == (
            source.gps,
            source.compass,
            source.imu,
            source.speed,
        )


def test_the_delay_of_the_cameras_holds_for_all_sensors_unless_told_otherwise() -> None:
    seen = observed(SensorDelay(camera_ms=100), range(10))[-1]
    assert (seen.tick, seen.cameras["front"].tick, seen.gps.tick) == (9, 7, 7)


def test_ticks_that_nobody_observed_are_bridged_by_the_newest_old_enough_capture() -> None:
    driven = observed(SensorDelay(camera_ms=100), [0, 3, 4, 9])
    assert [seen.cameras["front"].tick for seen in driven] == [0, 0, 0, 4]


def test_late_images_survive_the_simulator_reusing_its_pixels() -> None:
    stack = started(SensorDelay(camera_ms=100))
    buffer = np.zeros((6, 8, 3), dtype=np.uint8)
    shown = []
    for tick in range(6):
        buffer[...] = 10 * tick
        shown.append(int(stack.observe(observation_at(tick, pixels=buffer)).cameras["front"].pixels[0, 0, 0]))
    assert shown == [0, 0, 0, 10, 20, 30]


def test_no_delay_is_the_identity() -> None:
    clean = observation_at(5)
    assert started(SensorDelay(camera_ms=0)).observe(clean) is clean


def test_a_delay_of_the_other_signals_stays_what_it_is_where_that_of_the_cameras_is_searched() -> None:
    assert str(SensorDelay(camera_ms=100, ego_ms=100)) == "100 ms sensor delay (ego_ms=100)"
    ladder = ladder_of(SensorDelay(camera_ms=0, ego_ms=0), dt_s=0.05)
    assert ladder.at(300) == SensorDelay(camera_ms=300, ego_ms=0)
    assert str(SensorDelay(camera_ms=0, ego_ms=50)) == "0 ms sensor delay (ego_ms=50)"


@pytest.mark.parametrize("perturbation", [SensorDelay(camera_ms=20), SensorDelay(camera_ms=100, ego_ms=49)])
def test_a_delay_below_one_tick_is_refused(perturbation: SensorDelay) -> None:
    with pytest.raises(PerturbationError, match=r"_ms is (20|49)\b"):
        started(perturbation)


def test_the_record_names_the_delayed_signals_only() -> None:
    stack = started(SensorDelay(camera_ms=0, ego_ms=100))
    for tick in range(4):
        stack.observe(observation_at(tick))
    assert [item.signal for item in stack.schedule()] == ["gps", "compass", "imu", "speed"]
