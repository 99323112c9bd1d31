"""Route files: the leaderboard's schema in and out, and our generator."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_drive_robust.domain.route import RoadOption, Route
from pytest_drive_robust.errors import RouteError, UnknownNameError
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.dense_route import lay_route
from pytest_drive_robust.simulators.embedded.generate import draw_routes, main
from pytest_drive_robust.simulators.embedded.route_sets import named_routes, set_names
from pytest_drive_robust.simulators.embedded.route_xml import load_routes, save_routes
from pytest_drive_robust.simulators.embedded.traced.schema import READERS, SCHEMA
from pytest_drive_robust.simulators.embedded.world import World

ROUTES = named_routes("full")
GOOD = """<routes><route id="7" town="Town03"><waypoints>
<position x="0" y="1.7" z="0"/><position x="50" y="1.7" z="0"/></waypoints>
<scenarios><scenario name="HardBreakRoute_1" type="HardBreakRoute"><trigger_point x="5" y="1.7" z="0" yaw="0"/>
<distance value="40"/><direction value="right"/><source_dist_interval from="15" to="28"/></scenario></scenarios>
<weathers><weather route_percentage="0" fog_density="12"/></weathers></route></routes>"""
DISTANCE = '<distance value="40"/>'
CLEAR, NIGHT = '<weather route_percentage="0" fog_density="12"/>', '<weather sun_altitude_angle="-60"/>'
STREET_TEXT = f"""<routes><route id="7" town="Street1"><waypoints>
<position x="-50" y="1.8" z="0"/><position x="-10" y="1.8" z="0"/></waypoints><scenarios>
<scenario name="s" type="Accident"><trigger_point x="-45" y="1.8" z="0" yaw="0"/>{DISTANCE}</scenario></scenarios>
<weathers><weather route_percentage="0" fog_density="12"/></weathers></route></routes>"""


def test_five_routes_for_each_of_44_scenario_types() -> None:
    types = [route.scenario.type for route in ROUTES]
    assert len(ROUTES) == 220
    assert len(set(types)) == 44
    assert all(types.count(name) == 5 for name in types)
    assert [route.scenario.type for route in named_routes("one-per-scenario")] == sorted(set(types))


def test_a_saved_file_reads_back_to_equal_routes(tmp_path: Path) -> None:
    save_routes(ROUTES, tmp_path / "again.xml")
    assert load_routes(tmp_path / "again.xml") == ROUTES


def test_the_shipped_file_is_what_the_generator_draws(tmp_path: Path) -> None:
    assert main([str(tmp_path / "drawn.xml"), "--seed", "0", "--per-type", "5"]) == 0
    assert load_routes(tmp_path / "drawn.xml") == ROUTES


def test_another_seed_draws_other_routes() -> None:
    def places(routes: tuple[Route, ...] | list[Route]) -> set[tuple[str, float]]:
        return {(route.town, route.waypoints[0].x_m) for route in routes}

    assert not places(draw_routes(seed=1, per_type=1)) & places(ROUTES)


def test_parameters_texts_and_weather_are_read(tmp_path: Path) -> None:
    path = tmp_path / "one.xml"
    path.write_text(GOOD, encoding="utf-8")
    (route,) = load_routes(path)
    assert route.scenario.number("distance", 0.0) == 40.0
    assert route.scenario.number("source_dist_interval", 0.0, attribute="to") == 28.0
    assert route.scenario.number("speed", 13.0) == 13.0
    assert route.scenario.texts == {"direction": "right"}
    assert route.weather.fog_density == 12.0


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("<routes>", "<router>"), "not a route XML file"),
        (('id="7"', ""), "has no id"),
        (('id="7"', 'id=" "'), "route ' ': --drive-routes could not name it"),
        (('id="7"', 'id="7,8"'), "route '7,8': --drive-routes could not name it. Give it an id without commas"),
        (('id="7"', 'id="a:7"'), "route 'a:7': --drive-routes could not name it"),
        (('id="7"', 'id="7.xml"'), "route '7.xml': --drive-routes could not name it"),
        (('town="Town03"', ""), "has no town"),
        (('x="50"', 'x="fifty"'), "x='fifty', expected a finite number"),
        (('x="50"', 'x="nan"'), "expected a finite number"),
        (('type="HardBreakRoute"', ""), "has no type"),
        (('<trigger_point x="5" y="1.7" z="0" yaw="0"/>', ""), "has no <trigger_point>"),
        (('<position x="50" y="1.7" z="0"/>', ""), "1 waypoint(s), expected at least 2"),
        (("<routes>", '<!DOCTYPE r [<!ENTITY a "b">]><routes>'), "not a route XML file"),
    ],
)
def test_a_broken_file_is_one_clear_error(tmp_path: Path, change: tuple[str, str], expected: str) -> None:
    path = tmp_path / "broken.xml"
    path.write_text(GOOD.replace(*change), encoding="utf-8")
    with pytest.raises(RouteError, match=r"broken\.xml") as caught:
        load_routes(path)
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (STREET_TEXT.replace(DISTANCE, '<distance value="abc"/>'), "<distance> has value='abc', expected a finite"),
        (STREET_TEXT.replace(DISTANCE, '<distance value="-40"/>'), "<distance> has value=-40, expected 0 to 500"),
        (STREET_TEXT.replace(DISTANCE, '<distance value="1e9"/>'), "<distance> has value=1e+09, expected 0 to 500"),
        (STREET_TEXT.replace(DISTANCE, '<distance valeu="9"/>'), "<distance> has no value"),
        (STREET_TEXT.replace(DISTANCE, '<distance valeu="far"/>'), "<distance> has valeu='far', expected a finite"),
        (STREET_TEXT.replace(DISTANCE, '<distance value="40" x="1"/>'), "<distance> has an attribute 'x', expected v"),
        (
            STREET_TEXT.replace(DISTANCE, '<distnace value="90"/>'),
            "<distnace> is no element of Accident, did you mean 'distance'?",
        ),
        (
            STREET_TEXT.replace(DISTANCE, "<distnace/>"),
            "<distnace> is no element of Accident, did you mean 'distance'?",
        ),
        (STREET_TEXT.replace(DISTANCE, '<start_actor_flow x="1" y="2"/>'), "<start_actor_flow> is no element of A"),
        (STREET_TEXT.replace(DISTANCE, '<blocker_model value="van"/>'), "<blocker_model> is no element of Accident"),
        (STREET_TEXT.replace(DISTANCE, '<direction value="lefft"/>'), "<direction> is 'lefft', expected left or right"),
        (STREET_TEXT.replace('x="-45"', 'x="5000"'), "is 5010.0 m from its waypoints, 5050.0 m from the start"),
        (STREET_TEXT.replace('x="-45"', 'x="-110"'), "is 60.0 m from its waypoints, -60.0 m from the start"),
        (
            STREET_TEXT.replace('x="-45"', 'x="0"'),
            "50.0 m from the start; expected 25 m at most, and between 0 and the",
        ),
    ],
)
def test_what_would_have_no_effect_on_our_towns_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "own.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RouteError, match="route 7: ") as caught:
        EmbeddedSimulator().check_route(load_routes(path)[0])
    assert says in str(caught.value)


@pytest.mark.parametrize("town", ["Town77", "Town1", "Town123", "Town16"])
@pytest.mark.parametrize(
    ("was", "becomes", "says"),
    [
        (DISTANCE, '<distnace value="90"/>', "<distnace> is no element of Accident, did you mean 'distance'?"),
        (DISTANCE, '<distnace value="inf"/>', "<distnace> is no element of Accident, did you mean 'distance'?"),
        (DISTANCE, '<distance value="40" z="inf"/>', "<distance> has z='inf', expected a finite number"),
        (CLEAR, CLEAR + NIGHT, "elements differ, but the weather of a route does not change"),
    ],
)
def test_nor_is_it_on_a_polyline_of_ones_own(tmp_path: Path, town: str, was: str, becomes: str, says: str) -> None:
    text = STREET_TEXT.replace('town="Street1"', f'town="{town}"').replace(was, becomes)
    (tmp_path / "own.xml").write_text(text, encoding="utf-8")
    with pytest.raises(RouteError, match="route 7: ") as caught:
        load_routes(tmp_path / "own.xml")
    assert says in str(caught.value)


STRANGE = [
    (
        "<weathers>",
        f"{CLEAR}<weathers>",
        "<route> has no element 'weather': it belongs in <weathers>. Known: waypoints",
    ),
    ("<weathers>", "<weater/><weathers>", "<route> has no element 'weater', did you mean 'weathers'? Known: waypoints"),
    ("<weathers>", '<seed value="3"/><weathers>', "<route> has no element 'seed'"),
    ('id="7"', 'id="7" wheather="x"', "<route> has no attribute 'wheather'"),
    ('x="-50"', 'x="-50" speed="3"', "<position> has no attribute 'speed'. Known: x, y, z"),
    ("<waypoints>", "<waypoints><positon/>", "<waypoints> has no element 'positon', did you mean 'position'?"),
    ("<waypoints>", '<waypoints step="2">', "<waypoints> has no attribute 'step'. Known: none"),
    ("<scenarios>", "<scenarios><scenaro/>", "<scenarios> has no element 'scenaro', did you mean 'scenario'?"),
    ('name="s"', 'name="s" tpye="b"', "<scenario> has no attribute 'tpye', did you mean 'type'?"),
    ('yaw="0"', 'yaw="0" roll="3"', "<trigger_point> has no attribute 'roll'. Known: x, y, z, yaw"),
    ("<weathers>", "<weathers><wheather/>", "<weathers> has no element 'wheather', did you mean 'weather'?"),
    (DISTANCE, f'{DISTANCE}<distance value="45"/>', "<distance> stands 2 times in its scenario, expected once"),
    (DISTANCE, "<distance value='9'><to/></distance>", "<distance> has no element 'to'"),
]


@pytest.mark.parametrize("town", ["Street1", "Town77"])
@pytest.mark.parametrize(("was", "becomes", "says"), STRANGE)
def test_what_nothing_reads_is_refused_outside_of_scenarios_too(
    tmp_path: Path, town: str, was: str, becomes: str, says: str
) -> None:
    text = STREET_TEXT.replace('town="Street1"', f'town="{town}"').replace(was, becomes, 1)
    (tmp_path / "own.xml").write_text(text, encoding="utf-8")
    with pytest.raises(RouteError, match="route 7: ") as caught:
        load_routes(tmp_path / "own.xml")
    assert says in str(caught.value)


@pytest.mark.parametrize(("was", "becomes", "says"), STRANGE)
def test_files_of_the_leaderboard_are_read_whatever_else_stands_in_them(
    tmp_path: Path, was: str, becomes: str, says: str
) -> None:
    text = STREET_TEXT.replace('town="Street1"', 'town="Town12"').replace(was, becomes, 1)
    (tmp_path / "official.xml").write_text(text, encoding="utf-8")
    assert load_routes(tmp_path / "official.xml")[0].id == "7", says


def test_a_town_that_is_not_there_is_told_with_its_route() -> None:
    route = replace(ROUTES[0], town="Bielefeld")
    with pytest.raises(RouteError, match=f"^route {route.id}: town 'Bielefeld' is none of ours"):
        World(route, seed=0, options=SimulatorOptions())


def test_a_misspelt_route_is_refused(tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text(STREET_TEXT.replace("</routes>", "<rout/></routes>"), encoding="utf-8")
    with pytest.raises(RouteError, match=r"<routes> has no element 'rout', did you mean 'route'\?"):
        load_routes(tmp_path / "own.xml")


def test_a_parameter_that_its_scenario_type_does_not_read_is_refused(tmp_path: Path) -> None:
    text = STREET_TEXT.replace(DISTANCE, '<flow_distance value="40"/>')
    (tmp_path / "own.xml").write_text(text, encoding="utf-8")
    with pytest.raises(RouteError, match=r"<flow_distance> is no element of Accident.*direction, distance, speed\)"):
        load_routes(tmp_path / "own.xml")


class _Noting(dict[str, Any]):
    """Notes which names it was asked for."""

    def __init__(self, given: Mapping[str, Any]) -> None:
        super().__init__(given)
        self.asked: set[str] = set()

    def get(self, name: str, default: Any = None) -> Any:
        self.asked.add(name)
        return super().get(name, default)


def test_the_elements_of_a_scenario_type_are_those_that_its_code_reads() -> None:
    asked: dict[str, set[str]] = {}
    for route in named_routes("one-per-scenario"):
        spec = replace(route.scenario, parameters=_Noting(route.scenario.parameters))
        World(replace(route, scenario=spec), seed=0, options=SimulatorOptions())
        asked[spec.type] = spec.parameters.asked.intersection(READERS)  # type: ignore[attr-defined]
    assert asked == {kind: {name for name, types in READERS.items() if kind in types} for kind in SCHEMA}


def test_what_only_carla_reads_may_stand_in_its_towns(tmp_path: Path) -> None:
    text = STREET_TEXT.replace('town="Street1"', 'town="Town12"').replace(DISTANCE, '<blocker_model value="van"/>')
    (tmp_path / "official.xml").write_text(text, encoding="utf-8")
    assert load_routes(tmp_path / "official.xml")[0].scenario.texts == {"blocker_model": "van"}


@pytest.mark.parametrize("metres_per_s", [0.0, -5.0])
def test_a_flow_that_does_not_drive_is_refused(tmp_path: Path, metres_per_s: float) -> None:
    route = next(route for route in ROUTES if "flow_speed" in route.scenario.parameters)
    flow = {**route.scenario.parameters, "flow_speed": {"value": metres_per_s}}
    save_routes([replace(route, scenario=replace(route.scenario, parameters=flow))], tmp_path / "own.xml")
    with pytest.raises(RouteError, match=r"<flow_speed> has value=-?\d, expected 0\.1 to 50"):
        load_routes(tmp_path / "own.xml")


@pytest.mark.parametrize(
    ("weathers", "says"),
    [
        (CLEAR + NIGHT, "its 2 <weather> elements differ, but the weather of a route does not change"),
        ('<weather cloudines="50"/>', "<weather> has no attribute 'cloudines', did you mean 'cloudiness'?"),
        ('<weather id="clear noon"/>', "<weather> has no attribute 'id'. Known: route_percentage, cloudiness,"),
        ('<weather route_percentage="half"/>', "<weather> has route_percentage='half', expected a finite number"),
    ],
)
def test_a_weather_that_would_not_be_seen_is_refused(tmp_path: Path, weathers: str, says: str) -> None:
    path = tmp_path / "weather.xml"
    path.write_text(STREET_TEXT.replace(CLEAR, weathers), encoding="utf-8")
    with pytest.raises(RouteError, match="route 7: ") as caught:
        load_routes(path)
    assert says in str(caught.value)


def test_a_route_of_the_leaderboard_has_the_weather_of_its_start(tmp_path: Path) -> None:
    changing = NIGHT.replace("<weather", '<weather route_percentage="100" dust_storm="0"') + CLEAR
    text = STREET_TEXT.replace('town="Street1"', 'town="Town03"').replace(CLEAR, changing)
    (tmp_path / "changing.xml").write_text(text, encoding="utf-8")
    (route,) = load_routes(tmp_path / "changing.xml")
    assert (route.weather.fog_density, route.weather.sun_altitude_angle) == (12.0, 45.0)


def test_unknown_names_come_with_the_nearest_one() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'one-per-scenario'"):
        named_routes("one-per-scenari")
    assert {"dev10", "full", "one-per-scenario"} <= set(set_names())


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.id)
def test_every_route_lies_on_its_lanes_and_has_a_sparse_plan(route: Route) -> None:
    dense = lay_route(route)
    assert 49.0 <= dense.length_m <= 222.0
    assert 0.0 <= dense.trigger_m <= 31.0
    points = dense.plan().points
    gaps = [np.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(points)]
    assert max(gaps) <= 51.0
    assert len(points) < dense.length_m / 8.0
    assert np.hypot(points[0].x_m - dense.rows[0, 0], points[0].y_m - dense.rows[0, 1]) < 1e-9
    turns = {point.command for point in points} & {RoadOption.LEFT, RoadOption.RIGHT}
    assert bool(turns) == any(abs(way.turn_rad) > 0.7 for way in dense.passages())


def test_a_route_off_its_town_is_refused() -> None:
    route = ROUTES[0]
    aside = tuple(type(p)(p.x_m, p.y_m + 40.0) for p in route.waypoints)
    with pytest.raises(RouteError, match="from the nearest lane of town"):
        lay_route(Route(route.id, route.town, aside, route.scenario))
    with pytest.raises(UnknownNameError, match=f"^route {route.id}: there is no town style named 'Streat'.*Street"):
        lay_route(Route(route.id, "Streat1", route.waypoints, route.scenario))


STREET = ROUTES[0]
CROSSING = replace(STREET.scenario, type="PedestrianCrossing", parameters={})


@pytest.mark.parametrize(
    ("route", "message"),
    [
        (replace(STREET, town="Steet1"), "Did you mean 'Street'?"),
        (replace(STREET, scenario=replace(STREET.scenario, type="HardBrakeRoute")), "Did you mean 'HardBreakRoute'?"),
        (replace(STREET, scenario=CROSSING), "needs a junction on its route"),
    ],
    ids=["town", "scenario", "place"],
)
def test_a_route_that_cannot_be_driven_ends_the_run_before_it_begins(
    tmp_path: Path, route: Route, message: str
) -> None:
    save_routes([route], tmp_path / "one.xml")
    (tmp_path / "test_it.py").write_text("def test_it(drive): drive.rd('clean')", encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "--drive-robust", "-q", "-p", "no:cacheprovider", str(tmp_path)]
    command += ["--drive-routes", "one.xml", "--drive-agent", "drive_robust_agents.constant:Constant"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.returncode == 4
    assert "1 of 1 routes cannot be driven:" in ended.stderr
    assert message in ended.stderr
