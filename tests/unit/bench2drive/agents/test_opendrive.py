"""The map as OpenDRIVE: read back as XML here, and by CARLA's own parser where the carla package is installed."""

from __future__ import annotations

import math
from importlib import metadata

import pytest
from defusedxml import ElementTree
from leaderboard_files import straight_lane, truth_with

from pytest_drive_robust.bench2drive.agents.opendrive import opendrive_of
from pytest_drive_robust.simulators.embedded.simulator import EmbeddedSimulator
from pytest_drive_robust.simulators.routes import resolve_routes


@pytest.fixture(scope="module")
def simulator():
    return EmbeddedSimulator()


@pytest.fixture(scope="module")
def carla():
    try:
        metadata.version("carla")
    except metadata.PackageNotFoundError:
        pytest.skip("the carla package is not installed")
    return pytest.importorskip("carla")


def fork():
    """A lane that parts into two, of which one leads back to a third."""
    lanes = (
        straight_lane(0, length_m=50.0, successors=(1, 2)),
        straight_lane(1, length_m=20.0, start_m=50.0, successors=(3,)),
        straight_lane(2, length_m=20.0, start_m=50.0, y_m=3.5),
        straight_lane(3, length_m=50.0, start_m=70.0),
    )
    return truth_with(lanes=lanes).lane_map


def test_every_lane_is_a_road_and_where_they_part_is_a_junction():
    root = ElementTree.fromstring(opendrive_of(fork()))
    roads = {road.get("id"): road for road in root.iter("road")}
    assert {"0", "1", "2", "3"} <= set(roads)
    inside = [road.get("id") for road in roads.values() if road.get("junction") != "-1"]
    assert inside == ["1", "2"]
    junction = root.find("junction")
    assert [(way.get("incomingRoad"), way.get("connectingRoad")) for way in junction] == [("0", "1"), ("0", "2")]
    assert roads["0"].find("link/successor").get("elementId") == junction.get("id")
    assert roads["1"].find("link/successor").get("elementId") == "3"


def test_a_road_leads_along_the_left_edge_and_north_is_up():
    lane_map = truth_with(lanes=(straight_lane(y_m=10.0),)).lane_map
    first = ElementTree.fromstring(opendrive_of(lane_map)).find("road/planView/geometry")
    assert float(first.get("x")) == 0.0
    assert float(first.get("y")) == pytest.approx(-(10.0 - 1.75))
    assert float(first.get("hdg")) == pytest.approx(0.0)


def test_carla_finds_every_part_of_a_route_on_its_map(simulator, carla):
    for route in resolve_routes("dev10")[::4]:
        simulator.reset(route, seed=0, cameras=())
        truth = simulator.truth()
        found = carla.Map(truth.lane_map.name, opendrive_of(truth.lane_map))
        assert found.get_topology()
        for x_m, y_m, yaw, _ in truth.route[::10].tolist():
            waypoint = found.get_waypoint(carla.Location(x=x_m, y=y_m, z=0.0))
            place, turned = waypoint.transform.location, math.radians(waypoint.transform.rotation.yaw)
            assert math.hypot(place.x - x_m, place.y - y_m) < 2.0
            assert math.cos(turned - yaw) > 0.95
