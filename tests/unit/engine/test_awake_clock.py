from __future__ import annotations

import pytest

from pytest_drive_robust.engine.awake_clock import AwakeClock


class Clock:
    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.mark.parametrize("step_s", [0.5, 1.0, 4.0])
def test_a_process_that_runs_measures_all_of_the_time(step_s: float) -> None:
    clock = Clock()
    awake = AwakeClock(clock)
    for _ in range(10):
        clock.now_s += step_s
        passed_s = awake.since(100.0)
    assert passed_s == pytest.approx(10.0 * step_s)


def test_the_time_in_which_a_process_was_stopped_does_not_count() -> None:
    clock = Clock()
    awake = AwakeClock(clock)
    clock.now_s += 1.0
    assert awake.since(100.0) == 1.0
    clock.now_s += 3600.0
    assert awake.since(100.0) == 1.0
    clock.now_s += 2.0
    assert awake.since(100.0) == 3.0
    assert awake.since(101.0) == 2.0
    assert awake.since(3701.5) == 1.5, "what began after the stop was not stopped"
    assert awake.since(3000.0) == 2.0, "what began in another process at its end"
    clock.now_s += 60.0
    assert awake.since(100.0) == 3.0
