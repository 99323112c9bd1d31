"""The path of `classical` through the sparse plan: shape, junctions, and the place on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from painted_roads import LEFT_TURN, STRAIGHT

from drive_robust_agents._classical.plan_path import PlanPath


def test_a_left_turn_becomes_a_quarter_circle() -> None:
    path = PlanPath(LEFT_TURN, 0.0)
    away = np.hypot(path.points[:, 0] - 30.0, path.points[:, 1] + 12.0)
    turning = (path.points[:, 0] > 30.5) & (path.points[:, 1] > -11.5)
    assert turning.sum() > 20
    assert np.allclose(away[turning], 12.0, atol=0.15)


def test_the_path_passes_every_point_of_the_plan() -> None:
    path = PlanPath(LEFT_TURN, 0.0)
    for point in LEFT_TURN.points:
        assert np.hypot(path.points[:, 0] - point.x_m, path.points[:, 1] - point.y_m).min() < 0.3


def test_the_junction_begins_where_the_command_changes() -> None:
    path = PlanPath(LEFT_TURN, 0.0)
    (junction,) = path.junctions
    assert junction.entry_m == pytest.approx(30.0, abs=0.1)
    assert junction.exit_m - junction.entry_m == pytest.approx(12.0 * math.pi / 2.0, abs=0.3)
    assert path.next_junction(20.0) is junction
    assert path.next_junction(junction.exit_m + 1.0) is None


def test_raw_gps_moves_the_place_on_the_path_both_ways() -> None:
    path = PlanPath(STRAIGHT, 0.0)
    assert [path.locate(x, 3.0) for x in (5.0, 12.0, 8.0)] == [5.0, 12.0, 8.0]
