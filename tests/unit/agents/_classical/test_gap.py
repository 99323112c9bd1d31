"""When `classical` enters the lane to the left from standing."""

from __future__ import annotations

import numpy as np
from painted_roads import TYRE, road

from drive_robust_agents._classical.gap import Gap


def test_it_enters_right_after_somebody_has_driven_past_and_away() -> None:
    gap, image = Gap(), road()
    seen = [gap.open(np.array([near, near]), image, 1) for near in np.arange(3.0, 20.0, 0.45)]
    assert not any(seen[:20])
    assert seen[-1]


def test_one_look_in_four_ticks_sees_the_same_drive() -> None:
    gap, image = Gap(), road()
    seen = [gap.open(np.array([near, near]), image, 4) for near in np.arange(3.0, 20.0, 1.8)]
    assert not any(seen[:5])
    assert seen[-1]
    slow = Gap()
    assert not any(slow.open(np.array([near, near]), image, 4) for near in np.arange(3.0, 20.0, 0.6))


def test_somebody_who_has_just_set_off_has_others_close_behind() -> None:
    gap, image = Gap(), road()
    assert not any(gap.open(np.array([near, near]), image, 1) for near in np.arange(3.0, 20.0, 0.15))


def test_it_does_not_enter_against_what_comes() -> None:
    gap, image = Gap(), road()
    assert not any(gap.open(np.array([near, near]), image, 1) for near in np.arange(40.0, 3.0, -0.45))


def test_what_moves_far_ahead_closes_a_lane_that_nobody_was_seen_in() -> None:
    empty, busy = Gap(), Gap()
    still, moving = road(), road()
    moving[72:76, 112:118] = TYRE
    free = [empty.open(np.empty(0), still, 1) for _ in range(140)]
    taken = [busy.open(np.empty(0), moving if tick >= 100 else still, 1) for tick in range(140)]
    assert free[-1]
    assert not taken[-1]
