"""`classical` goes around what stands in its lane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from painted_roads import road

from drive_robust_agents._classical.overtake import Overtake

_BLOCK = np.array([(8.0, 0.0), (8.0, 0.3)])


def _stand(overtake: Overtake, image: NDArray[np.uint8], points: NDArray[np.float64] = _BLOCK) -> None:
    """Seven seconds behind points (k, 2), metres along the lane and to its right."""
    for _ in range(140):
        overtake.update(image, *points.T, speed_mps=0.0, ticks=1, allowed=True)


def test_it_goes_around_what_stands_in_its_lane_and_comes_back() -> None:
    overtake, image = Overtake(), road()
    _stand(overtake, image)
    assert overtake.passing
    nothing = np.empty(0)
    offsets = []
    for _ in range(70):
        overtake.update(image, nothing, nothing, speed_mps=5.0, ticks=1, allowed=True)
        offsets.append(overtake.offset_m)
    assert min(offsets) < -3.0
    assert offsets[-1] == 0.0
    assert not overtake.passing


def test_it_waits_behind_brake_lamps_and_in_front_of_a_lane_in_use() -> None:
    braking, busy = Overtake(), Overtake()
    image = road()
    image[80:84, 118:121] = (254, 46, 32)
    _stand(braking, image)
    _stand(busy, road(), np.concatenate((_BLOCK, [(20.0, -3.5), (20.0, -3.0)])))
    assert not braking.passing
    assert not busy.passing


def test_it_falls_back_when_what_stood_there_drives_off() -> None:
    overtake, image = Overtake(), road()
    _stand(overtake, image)
    for tick in range(20):
        ahead = np.full(2, 8.0 + 0.4 * tick)
        overtake.update(image, ahead, np.array([0.0, 0.3]), speed_mps=1.0, ticks=1, allowed=True)
    assert not overtake.passing


def test_one_look_in_four_ticks_waits_and_moves_aside_for_as_long() -> None:
    often, seldom, image = Overtake(), Overtake(), road()
    begins = []
    for overtake, ticks in ((often, 1), (seldom, 4)):
        tick = 0
        while not overtake.passing:
            overtake.update(image, *_BLOCK.T, speed_mps=0.0, ticks=ticks, allowed=True)
            tick += ticks
        begins.append(tick)
    assert abs(begins[0] - begins[1]) <= 4
    nothing = np.empty(0)
    for overtake, ticks in ((often, 1), (seldom, 4)):
        for _ in range(0, 12, ticks):
            overtake.update(image, nothing, nothing, speed_mps=5.0, ticks=ticks, allowed=True)
    assert abs(often.offset_m - seldom.offset_m) < 1e-9
    assert often.offset_m < -1.0
