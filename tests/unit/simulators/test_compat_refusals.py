"""What the port does not stand for is refused by name, before anything is driven."""

from __future__ import annotations

import pytest
from compat_roads import crowded_road
from highway_env.road.lane import CircularLane, PolyLaneFixedWidth, SineLane, StraightLane
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.dynamics import BicycleVehicle
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import RoadObject

from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.compat import CompatRoad


class Hurried(IDMVehicle):
    TIME_WANTED = 0.5


class Stubborn(IDMVehicle):
    def mobil(self, lane_index: tuple[str, str, int]) -> bool:
        return True


class Puddle(RoadObject):
    def __init__(self, road: Road, position: tuple[float, float]) -> None:
        super().__init__(road, position)


class FrozenRoad(Road):
    def step(self, dt: float) -> None:
        pass


class NarrowingLane(StraightLane):
    def width_at(self, longitudinal: float) -> float:
        return 3.0


def test_a_poly_lane_is_refused() -> None:
    network = RoadNetwork()
    network.add_lane("a", "b", PolyLaneFixedWidth([(0.0, 0.0), (10.0, 0.0), (20.0, 1.0)]))
    with pytest.raises(
        SimulationError, match=r"a lane of class 'PolyLaneFixedWidth'.*CircularLane, SineLane, Straight"
    ):
        CompatRoad.from_road(Road(network))


def test_a_lane_with_its_own_geometry_is_refused() -> None:
    network = RoadNetwork()
    network.add_lane("a", "b", NarrowingLane([0.0, 0.0], [10.0, 0.0]))
    with pytest.raises(SimulationError, match=r"'NarrowingLane', which has a width_at\(\) of its own"):
        CompatRoad.from_road(Road(network))


@pytest.mark.parametrize("kind", [BicycleVehicle, Stubborn])
def test_a_vehicle_with_behaviour_of_its_own_is_refused(kind: type[Vehicle]) -> None:
    road = crowded_road("highway", seed=0, count=2, kinds=(IDMVehicle, kind))
    with pytest.raises(SimulationError, match=f"a vehicle of class '{kind.__name__}'.*MDPVehicle"):
        CompatRoad.from_road(road)


def test_a_vehicle_that_only_sets_parameters_is_known() -> None:
    roads = [crowded_road("highway", seed=0, kinds=(kind,)) for kind in (IDMVehicle, Hurried)]
    speeds = []
    for road in roads:
        compat = CompatRoad.from_road(road)
        for _ in range(20):
            compat.step(0.05)
        speeds.append(compat.speeds_mps.tolist())
    assert speeds[0] != speeds[1]


def test_an_unknown_object_is_refused() -> None:
    road = crowded_road("highway", seed=0, count=2)
    road.objects.append(Puddle(road, (0.0, 0.0)))
    with pytest.raises(SimulationError, match=r"an object of class 'Puddle'.*Landmark, Obstacle"):
        CompatRoad.from_road(road)


def test_the_yielding_rule_is_left_out_only_on_request() -> None:
    plain = crowded_road("intersection", seed=0, count=3)
    road = RegulatedRoad(plain.network, plain.vehicles)
    with pytest.raises(SimulationError, match=r"'RegulatedRoad' without its yielding rule.*ignore_road_rules=True"):
        CompatRoad.from_road(road)
    assert len(CompatRoad.from_road(road, ignore_road_rules=True).crashed) == 3


def test_a_road_with_a_step_of_its_own_is_refused() -> None:
    with pytest.raises(SimulationError, match=r"a road of class 'FrozenRoad', which has a step\(\) of its own"):
        CompatRoad.from_road(FrozenRoad(crowded_road("highway", seed=0, count=1).network))


def test_an_ego_from_somewhere_else_is_refused() -> None:
    road, other = (crowded_road("highway", seed=0, count=2) for _ in range(2))
    with pytest.raises(SimulationError, match="not among the road's vehicles"):
        CompatRoad.from_road(road, ego=other.vehicles[0])


@pytest.mark.parametrize(
    ("kind", "action", "message"),
    [
        (Vehicle, "FASTER", r"a Vehicle, cannot be told 'FASTER': give \(acceleration_mps2, steering_rad\)"),
        (MDPVehicle, (1.0, 0.0), r"a MDPVehicle, cannot be told \(1.0, 0.0\): give one of FASTER, IDLE"),
        (IDMVehicle, "FASTER", "a IDMVehicle, drives itself and cannot be told 'FASTER': give None"),
        (MDPVehicle, "LANE_LEFTT", "Did you mean 'LANE_LEFT'"),
    ],
)
def test_an_ego_is_told_only_what_it_understands(
    kind: type[Vehicle], action: tuple[float, float] | str, message: str
) -> None:
    road = crowded_road("highway", seed=0, count=2, kinds=(kind,))
    compat = CompatRoad.from_road(road, ego=road.vehicles[0])
    with pytest.raises(SimulationError, match=message):
        compat.step(0.05, action)


def test_nobody_is_told_anything_without_an_ego() -> None:
    compat = CompatRoad.from_road(crowded_road("highway", seed=0, count=2))
    assert compat.ego is None
    with pytest.raises(SimulationError, match="got no ego"):
        compat.step(0.05, (0.0, 0.0))


def test_a_route_over_lanes_that_do_not_exist_is_refused() -> None:
    road = crowded_road("merge", seed=0, count=2)
    road.vehicles[0].route = [("a", "z", None)]
    with pytest.raises(SimulationError, match="from 'a' to 'z', where the network has no lane"):
        CompatRoad.from_road(road)
    road.vehicles[0].route = [("a", "b", 7)]
    with pytest.raises(SimulationError, match="asks for an id from 0 to"):
        CompatRoad.from_road(road)


def test_all_kinds_of_lanes_are_read() -> None:
    network = RoadNetwork()
    network.add_lane("a", "b", StraightLane([0, 0], [20, 0], speed_limit=None))
    network.add_lane("b", "c", SineLane([20, 0], [60, 0], 2.0, 0.1, 0.0))
    network.add_lane("c", "a", CircularLane([30, 0], 30.0, 0.0, 3.0))
    road = Road(network)
    road.vehicles = [IDMVehicle(road, (5.0, 0.2), 0.0, 8.0, target_speed=9.0)]
    twin = Road(network)
    twin.vehicles = [IDMVehicle(twin, (5.0, 0.2), 0.0, 8.0, target_speed=9.0)]
    compat = CompatRoad.from_road(twin)
    visited = set()
    for _ in range(300):
        road.act()
        road.step(0.05)
        compat.step(0.05)
        visited.add(compat.lane_indices[0])
        assert np_equal(road, compat)
    assert visited == {("a", "b", 0), ("b", "c", 0), ("c", "a", 0)}


def np_equal(road: Road, compat: CompatRoad) -> bool:
    error = abs(road.vehicles[0].position - compat.positions_m[0]).max()
    return bool(error <= (0.0 if compat.exact else 1e-9))
