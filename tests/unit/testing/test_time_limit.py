from __future__ import annotations

import signal
import time

import pytest

from pytest_drive_robust.testing.time_limit import with_time_limit

pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="signals end calls where there are some")


class Calling:
    """Calls another of its methods before it hangs."""

    def plan(self) -> None: ...

    def act(self, observation: object) -> None:
        self.plan()
        time.sleep(600.0)


def test_a_call_that_has_made_another_one_is_ended_all_the_same():
    with pytest.raises(TimeoutError, match=r"the call takes more than 0.1 s"):
        with_time_limit(Calling(), 0.1).act(None)


def test_a_timer_of_somebody_else_goes_on_after_a_call():
    before = signal.setitimer(signal.ITIMER_REAL, 500.0, 7.0)
    try:
        with_time_limit(Calling(), 60.0).plan()
        left_s, again_s = signal.getitimer(signal.ITIMER_REAL)
        assert 0.0 < left_s <= 500.0
        assert again_s == 7.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, *before)


def test_a_limit_of_many_years_is_a_limit_and_no_fault_of_the_agent():
    with_time_limit(Calling(), 1e17).plan()
