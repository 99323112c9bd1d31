"""The lane changes that a route asks for."""

from __future__ import annotations

import math

import pytest

from drive_robust_agents._planning.lane_changes import LaneChanges
from drive_robust_agents._planning.static_scene import StaticScene
from pytest_drive_robust.simulators.embedded.routes import named_routes
from pytest_drive_robust.simulators.embedded.world import World


def test_lane_changes_of_a_route_are_found_with_room_on_both_sides() -> None:
    route = next(route for route in named_routes("full") if route.scenario.type == "MergerIntoSlowTraffic")
    world = World(route, seed=0)
    scene = StaticScene(world.truth(world.now()))
    (change,) = scene.changes
    assert change.first < change.start < change.last
    assert abs(change.old[change.start]) < 0.2
    assert abs(change.new[change.start : change.last]).min() < 0.2
    lanes = LaneChanges(scene)
    assert lanes.pending is change
    assert lanes.profile[change.last] == pytest.approx(change.old[change.last])
    assert lanes.candidate(change.start - 80.0, 10.0) is None
    changed = lanes.candidate(float(change.start), 10.0)
    assert changed is not None
    lanes.adopt(changed)
    assert lanes.pending is None
    assert lanes.stop_row() == math.inf
