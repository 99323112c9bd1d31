"""Routes of the leaderboard, whose towns are built around them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from official_like import Shape, draw, shape_for

from drive_robust_agents.expert import Expert
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.metrics.score import is_success
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.dense_route import DenseRoute, lay_route
from pytest_drive_robust.simulators.embedded.route_xml import load_routes, save_routes
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
from pytest_drive_robust.simulators.embedded.traced.schema import SCHEMA, Place, is_carla, is_traced
from pytest_drive_robust.simulators.embedded.traced.traced_route import _trace_route
from pytest_drive_robust.simulators.embedded.world import World

ON_THE_LANE_M = {Place.STREET: 0.6, Place.JUNCTION: 0.6, Place.CUT_IN: 0.6, Place.EXIT: 4.2, Place.ENTRY: 4.2}
"""Beside ramps the ego changes lanes where the leaderboard says nothing of how."""


def test_the_schema_knows_the_types_that_we_have() -> None:
    assert sorted(SCHEMA) == sorted(SCENARIOS)


@pytest.mark.parametrize(
    ("town", "traced"),
    [
        *(
            (name, True)
            for name in ("Town12", "Town10HD", "Town10HD_Opt", "Carla/Maps/Town01", "Town1", "Town77", "Town123")
        ),
        *((name, False) for name in ("Street12", "Town", "Town1234567", "Town1x", "MyTown12", "")),
    ],
)
def test_towns_of_carla_and_of_ones_own_polylines_are_told_from_ours(town: str, traced: bool) -> None:
    assert is_traced(town) is traced


@pytest.mark.parametrize("town", ["Town01", "Town10HD", "Town10HD_Opt", "Town12", "Town15", "Carla/Maps/Town07"])
def test_towns_of_carla_are_told_from_those_of_ones_own_polylines(town: str) -> None:
    assert is_carla(town)
    assert not any(map(is_carla, ("Town00", "Town1", "Town16", "Town77", "Town123", "Street1")))


@pytest.mark.parametrize("kind", sorted(SCHEMA))
def test_every_type_gets_a_road_along_its_waypoints(kind: str) -> None:
    for number in (0, 1):
        route = draw(kind, shape_for(kind, number))
        dense = World(route, seed=0).dense
        off = [np.hypot(dense.rows[:, 0] - p.x_m, dense.rows[:, 1] - p.y_m).min() for p in route.waypoints]
        limit = 1.8 if kind == "SequentialLaneChange" else ON_THE_LANE_M[SCHEMA[kind].roads.place]
        assert max(off) < limit
        assert np.abs(np.diff(dense.s) - 1.0).max() < 0.1
        assert (dense.first_junction_row() is not None) is (SCHEMA[kind].roads.place is Place.JUNCTION)
        assert 0.0 <= dense.trigger_m <= 12.0


@pytest.mark.parametrize("turn", [-110.0, -90.0, -60.0, 0.0, 60.0, 90.0, 110.0])
def test_a_junction_turns_as_its_waypoints_do(turn: float) -> None:
    dense = lay_route(draw("OppositeVehicleTakingPriority", Shape(turn_deg=turn, gap_m=26.0)))
    way = dense.first_passage()
    assert way is not None
    assert math.degrees(way.turn_rad) == pytest.approx(turn, abs=4.0)
    ways = [other for other in dense.town.passages if other.junction == way.junction]
    assert len(ways) == 12


def test_jumps_between_waypoints_are_changes_of_lane() -> None:
    changes = lay_route(draw("SequentialLaneChange")).lane_changes()
    assert [side for _, _, side in changes] == [-1, -1]


@pytest.mark.parametrize(
    ("kind", "controlled"),
    [
        ("SignalizedJunctionLeftTurn", "light"),
        ("VanillaNonSignalizedTurnEncounterStopsign", "stop"),
        ("VanillaNonSignalizedTurn", None),
    ],
)
def test_junctions_have_the_lights_and_signs_of_their_type(kind: str, controlled: str | None) -> None:
    lines = lay_route(draw(kind)).lane_map.stop_lines
    assert {("light" if line.is_light else "stop") for line in lines} == ({controlled} if controlled else set())


def _standing(route: Route) -> tuple[DenseRoute, np.ndarray]:
    """(route, (n, 2) metres ahead of the trigger and to the right of everything that stands)."""
    world = World(route, seed=0)
    there = world.state.actors[world.state.actor_ints[:, c.I_MODE] == c.MODE_STATIC]
    line = world.dense.rows
    nearest = [int(np.hypot(line[:, 0] - a[c.A_X], line[:, 1] - a[c.A_Y]).argmin()) for a in there]
    right = [
        (a[c.A_Y] - line[k, 1]) * math.cos(line[k, 2]) - (a[c.A_X] - line[k, 0]) * math.sin(line[k, 2])
        for a, k in zip(there, nearest, strict=True)
    ]
    return world.dense, np.column_stack([world.dense.s[nearest] - world.dense.trigger_m, right])


@pytest.mark.parametrize("kind", ["Accident", "ParkedObstacle", "ConstructionObstacle", "DynamicObjectCrossing"])
def test_distance_moves_what_happens(kind: str) -> None:
    near, far = (_standing(draw(kind, distance=metres, direction="right"))[1] for metres in (40, 55))
    assert far[:, 0].min() - near[:, 0].min() == pytest.approx(15.0, abs=1.5)


@pytest.mark.parametrize(
    "kind", ["Accident", "ParkedObstacle", "ParkingCrossingPedestrian", "ParkingExit", "StaticCutIn"]
)
def test_direction_mirrors_what_happens(kind: str) -> None:
    right, left = (_standing(draw(kind, direction=side))[1][:, 1] for side in ("right", "left"))
    assert right.mean() > 0.5
    assert left.mean() == pytest.approx(-right.mean(), abs=0.4)


def test_flows_have_the_speed_and_gaps_of_the_file() -> None:
    spans = {"from": 20.0, "to": 21.0}
    route = draw("NonSignalizedJunctionLeftTurn", flow_speed=7.5, source_dist_interval=spans)
    world = World(route, seed=0)
    flowing = world.state.actors[world.state.actor_ints[:, c.I_FLOW] == 0]
    assert flowing[:, c.A_V].max() == pytest.approx(7.5, abs=0.5)


@pytest.mark.parametrize("kind", [kind for kind in sorted(SCHEMA) if "start_actor_flow" in SCHEMA[kind].locations])
def test_given_flows_lead_from_place_to_place(kind: str) -> None:
    route = draw(kind)
    stage = World(route, seed=0).stage
    path = stage.given_flow()
    assert path is not None
    line = stage.paths[path]
    for name in ("start_actor_flow", "end_actor_flow"):
        at = route.scenario.parameters[name]
        assert np.hypot(line[:, 0] - at["x"], line[:, 1] - at["y"]).min() < 4.0


def test_bicycles_cross_where_the_route_turns() -> None:
    lanes = lay_route(draw("CrossingBicycleFlow")).lane_map.lanes
    assert sum(lane.kind is LaneKind.BIKING and lane.junction for lane in lanes) == 2


def test_the_same_route_is_the_same_town_again() -> None:
    route = draw("EnterActorFlow")
    first = lay_route(route)
    _trace_route.cache_clear()
    again = lay_route(route)
    assert first.lane_map is not again.lane_map
    assert first.rows.tobytes() == again.rows.tobytes()
    assert first.lane_map.buildings.tobytes() == again.lane_map.buildings.tobytes()


def test_routes_survive_a_file(tmp_path: Path) -> None:
    routes = tuple(draw(kind, route_id=str(k)) for k, kind in enumerate(sorted(SCHEMA)))
    save_routes(routes, tmp_path / "dense.xml")
    assert load_routes(tmp_path / "dense.xml") == routes


@pytest.mark.parametrize(
    ("route", "says"),
    [
        (draw("EnterActorFlow", start_actor_flow={"z": 1.0}), "<start_actor_flow> has no finite x and y"),
        (draw("Accident", direction="up"), "<direction> is 'up', expected left or right"),
        (draw("Accident", distance="far"), "<distance> has value='far', expected a finite number"),
        (draw("Accident", distance={"from": 3.0}), "<distance> has no value"),
        (draw("HighwayExit", flow_speed=-4.0), "<flow_speed> has value=-4, expected 0.1 to 50"),
        (draw("HighwayExit", Shape(gap_m=25.0, turn_deg=15.0)), "needs a stretch of 40 m or more without waypoints"),
        (draw("Accident", Shape(turn_deg=4000.0)), "bends so tightly"),
        (draw("Accident", Shape(at=(1e7, 0.0))), "expected 1000 km at most"),
    ],
)
def test_what_cannot_be_built_is_said(route: Route, says: str) -> None:
    with pytest.raises(RouteError, match=r"^route 1: ") as raised:
        World(route, seed=0)
    assert says in str(raised.value)


def test_the_expert_gets_through() -> None:
    simulator, expert = EmbeddedSimulator(), Expert()
    failed = []
    for kind in ("Accident", "ParkingExit", "SignalizedJunctionLeftTurn", "HighwayExit", "InterurbanAdvancedActorFlow"):
        result = drive_episode(simulator, expert, route=draw(kind), setting=Setting.CLEAN, seed=0, agent_name="expert")
        failed += [] if is_success(result) else [(kind, result.end_detail)]
    assert failed == []
