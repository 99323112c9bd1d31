"""The corridor of `classical`: where it ends, when it steps aside, what is oncoming."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drive_robust_agents._classical.corridor import Corridor, oncoming

PATH = np.column_stack((np.arange(44.0), np.zeros(44)))


def test_the_corridor_ends_at_what_blocks_it() -> None:
    corridor = Corridor()
    block = np.array([(15.0, -0.5), (15.2, 0.0), (15.0, 0.5)])
    corridor.update(block, PATH, 0.0, 0.05, may_dodge=True)
    assert corridor.free_m == pytest.approx(15.0, abs=0.3)


def test_the_corridor_forgets_what_it_no_longer_sees() -> None:
    corridor, nothing = Corridor(), np.empty((0, 2))
    corridor.update(np.array([(15.0, -0.5), (15.2, 0.0)]), PATH, 0.0, 0.05, may_dodge=True)
    corridor.update(nothing, PATH, 0.5, 0.05, may_dodge=True)
    assert corridor.free_m == pytest.approx(14.7, abs=0.3)
    for _ in range(10):
        corridor.update(nothing, PATH, 0.5, 0.05, may_dodge=True)
    assert corridor.free_m == math.inf


def test_it_steps_aside_for_something_still_at_the_right_edge() -> None:
    corridor = Corridor()
    parked = np.array([(20.0, right) for right in (0.6, 0.9, 1.2)])
    for _ in range(40):
        corridor.update(parked, PATH, 0.0, 0.05, may_dodge=True)
    assert corridor.aside_m == pytest.approx(-0.9, abs=0.1)
    assert corridor.free_m == math.inf


def test_one_look_in_four_ticks_steps_aside_as_fast() -> None:
    parked = np.array([(20.0, right) for right in (0.6, 0.9, 1.2)])
    aside = []
    for ticks in (1, 4):
        corridor = Corridor()
        for _ in range(0, 24, ticks):
            corridor.update(parked, PATH, 0.0, 0.05 * ticks, may_dodge=True)
        aside.append(corridor.aside_m)
    assert aside[0] < -0.5
    assert aside[1] == pytest.approx(aside[0], abs=0.2)


def test_it_waits_for_something_that_walks_in_from_the_right() -> None:
    corridor = Corridor()
    for tick in range(8):
        right = 1.6 - 2.0 * 0.05 * tick
        corridor.update(np.array([(12.0, right), (12.0, right + 0.2)]), PATH, 0.0, 0.05, may_dodge=True)
    assert corridor.free_m == pytest.approx(12.0, abs=0.3)


def test_a_car_in_the_lane_to_the_left_is_oncoming_and_a_post_is_not() -> None:
    assert oncoming(np.array([(12.0, -4.0), (12.0, -3.4), (12.0, -2.8)]))
    assert not oncoming(np.array([(12.0, -3.4), (12.0, -3.3)]))
    assert not oncoming(np.empty((0, 2)))
