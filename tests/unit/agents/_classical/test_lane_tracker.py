"""The lane is found between its markings and moves with the vehicle."""

from __future__ import annotations

import numpy as np
import pytest
from painted_roads import road

from drive_robust_agents._classical.lane_tracker import LaneTracker
from drive_robust_agents._classical.vision import CAMERA


@pytest.mark.parametrize("offset_m", [-0.6, 0.0, 0.5])
def test_the_lane_is_found_between_its_markings(offset_m: float) -> None:
    lane, image = LaneTracker(), road(offset_m)
    for _ in range(40):
        lane.see(image, np.full(len(lane.FORWARD_M), 98.0))
    assert lane.middle(np.array([8.0]))[0] == pytest.approx(offset_m, abs=0.12)
    assert lane.quality > 0.5


def test_the_lane_moves_with_the_vehicle() -> None:
    lane = LaneTracker()
    lane.forget(1.0, 0.1)
    lane.move(2.0, 0.1)
    assert lane.middle(np.array([0.0, 10.0])) == pytest.approx([1.2, 1.2])


def test_no_markings_no_confidence() -> None:
    lane, image = LaneTracker(), np.full((CAMERA.height_px, CAMERA.width_px, 3), 98, dtype=np.uint8)
    for _ in range(40):
        lane.see(image, np.full(len(lane.FORWARD_M), 98.0))
    assert lane.quality == 0.0
