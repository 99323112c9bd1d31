"""The lane changes that a route asks for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drive_robust_agents._planning.lane_changes import LaneChanges
from drive_robust_agents._planning.static_scene import StaticScene
from pytest_drive_robust.simulators.embedded.route_sets import named_routes
from pytest_drive_robust.simulators.embedded.world import World


def test_lane_changes_of_a_route_are_found_with_room_on_both_sides() -> None:
    route = next(route for route in named_routes("full") if route.scenario.type == "MergerIntoSlowTraffic")
    world = World(route, seed=0)
    scene = StaticScene(world.truth(world.now()))
    (change,) = scene.changes
    assert change.first < change.start < change.last
    assert abs(change.old[change.start]) < 0.2
    in_new_lane = abs(change.new) < 0.2
    end = change.start + int(np.argmax(in_new_lane[change.start :]))
    assert change.start < end < change.last
    assert in_new_lane[end : change.last].all()
    lanes = LaneChanges(scene)
    assert lanes.pending is change
    assert lanes.profile[end] == pytest.approx(change.old[end])
    assert lanes.candidate(change.start - 80.0, 10.0) is None
    changed = lanes.candidate(float(change.start), 10.0)
    assert changed is not None
    lanes.adopt(changed)
    assert lanes.pending is None
    assert lanes.stop_row() == math.inf
