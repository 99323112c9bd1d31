"""Read one `<route>` of a route file: its waypoints, its scenario, its weather.

Files for CARLA's towns (`official`) may have elements and attributes that only CARLA reads; on other towns these are
refused.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import fields

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint, Waypoint, Weather
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.traced.scenario_problems import nearest_hint
from pytest_drive_robust.simulators.embedded.traced.schema import is_carla, is_numeric

_WEATHER_RANGES = {"sun_azimuth_angle": (-360.0, 360.0), "sun_altitude_angle": (-90.0, 90.0)}
"""Ranges in degrees; all other attributes are percentages."""
_SHARE = "route_percentage"
_NOT_IN_IDS = frozenset(",:/")
"""Separators of ids, and of files and ids, in a route selection."""
_OF_CARLA = (
    "dust_storm", "fog_distance", "fog_falloff", "mie_scattering_scale", "rayleigh_scattering_scale",
    "scattering_intensity",
)  # fmt: skip
"""Attributes of `carla.WeatherParameters` that our worlds do not show."""
_NAMES: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "route": (("id", "town"), ("waypoints", "scenarios", "weathers")),
    "waypoints": ((), ("position",)),
    "position": (("x", "y", "z"), ()),
    "scenarios": ((), ("scenario",)),
    "trigger_point": (("x", "y", "z", "yaw"), ()),
    "weathers": ((), ("weather",)),
}
"""The known attributes and elements of each element; those of a scenario depend on its type (`scenario_problems`)."""
_CARLA_DEFAULT = -1.0
"""A percentage of -1 leaves the choice to CARLA; we then use our default."""


def read_route(element: ElementTree.Element) -> Route:
    """Return the route of a `<route>`. Raises `RouteError`; `scenario_problems` finds mistakes in the scenario."""
    route_id = _id(element)
    try:
        return _route(element, route_id)
    except RouteError as error:
        raise RouteError(f"route {route_id}: {error}") from None


def _id(element: ElementTree.Element) -> str:
    route_id = element.get("id")
    if not route_id:
        raise RouteError("a <route> has no id")
    if route_id != route_id.strip() or _NOT_IN_IDS.intersection(route_id) or route_id.endswith(".xml"):
        raise RouteError(
            f"route {route_id!r}: --drive-routes could not name it. Give it an id without commas, colons and slashes, "
            "without blanks at its ends and without .xml"
        )
    return route_id


def _route(element: ElementTree.Element, route_id: str) -> Route:
    town = element.get("town")
    if not town:
        raise RouteError("<route> has no town")
    official = is_carla(town)
    unread = [] if official else list(_unread(element))
    if unread:
        raise RouteError("; ".join(unread))
    positions = element.findall("waypoints/position")
    waypoints = tuple(Waypoint(*(_number(position, axis) for axis in ("x", "y", "z"))) for position in positions)
    if len(waypoints) < 2:
        raise RouteError(f"{len(waypoints)} waypoint(s), expected at least 2")
    scenarios = element.findall("scenarios/scenario")
    if len(scenarios) != 1:
        raise RouteError(f"{len(scenarios)} scenarios, expected exactly 1")
    scenario = _scenario(scenarios[0], official=official)
    return Route(route_id, town, waypoints, scenario, _weather(element, official=official))


def _unread(element: ElementTree.Element) -> Iterator[str]:
    """Yield a line for each unread name in an element and its children: unknown names, and elements given twice."""
    attributes, children = _NAMES.get(element.tag, (tuple(element.attrib), ()))
    if element.tag == "scenario":  # its known elements depend on the scenario type, and are checked elsewhere
        attributes, children = ("name", "type"), tuple(child.tag for child in element)
    for name in element.attrib:
        if name not in attributes:
            yield no_such_name(element.tag, "attribute", name, attributes)
    for child in element:
        if child.tag in children:
            yield from _unread(child)
        else:
            yield no_such_name(element.tag, "element", child.tag, children)
    if element.tag == "scenario":
        for name, times in Counter(child.tag for child in element).items():
            if times > 1:
                yield f"<{name}> stands {times} times in its scenario, expected once"


def no_such_name(element: str, what: str, name: str, known: tuple[str, ...]) -> str:
    """Return the message that an element has no such name, with the nearest known name or the element it belongs in."""
    home = next((tag for tag, (_, children) in _NAMES.items() if what == "element" and name in children), None)
    hint = f": it belongs in <{home}>." if home else nearest_hint(name, known) or "."
    return f"<{element}> has no {what} {name!r}{hint} Known: {', '.join(known) or 'none'}"


def _scenario(element: ElementTree.Element, *, official: bool) -> ScenarioSpec:
    """Read a scenario; off CARLA's towns every attribute is kept, so that one without effect can be refused."""
    kind = element.get("type")
    if not kind:
        raise RouteError("<scenario> has no type")
    trigger = element.find("trigger_point")
    if trigger is None:
        raise RouteError(f"scenario {kind} has no <trigger_point>")
    at = TriggerPoint(*(_number(trigger, name) for name in ("x", "y", "z", "yaw")))
    parameters: dict[str, dict[str, float]] = {}
    texts: dict[str, str] = {}
    for child in element:
        if child.tag == "trigger_point":
            continue
        if not official and is_numeric(child.tag):
            parameters[child.tag] = {name: _number(child, name) for name in child.attrib}
            continue
        numbers = {name: number for name, text in child.attrib.items() if (number := _finite(text)) is not None}
        if numbers:
            parameters[child.tag] = numbers
        elif "value" in child.attrib:
            texts[child.tag] = child.attrib["value"]
        elif not official:
            texts[child.tag] = ""
    return ScenarioSpec(element.get("name") or f"{kind}_1", kind, at, parameters, texts)


def _weather(element: ElementTree.Element, *, official: bool) -> Weather:
    found = []
    for each in element.findall("weathers/weather"):
        share = _number(each, _SHARE) if _SHARE in each.attrib else 0.0
        found.append((share, _one_weather(each, official=official)))
    if not found:
        return Weather()
    if not official and len({weather for _, weather in found}) > 1:
        raise RouteError(
            f"its {len(found)} <weather> elements differ, but the weather of a route does not change: keep one, or "
            "give all of them the same values"
        )
    return min(found, key=lambda one: one[0])[1]


def _one_weather(element: ElementTree.Element, *, official: bool) -> Weather:
    names = [field.name for field in fields(Weather)]
    for name in element.attrib:
        if name not in (*names, _SHARE, *(_OF_CARLA if official else ())):
            raise RouteError(no_such_name("weather", "attribute", name, (_SHARE, *names)))
    given = {name: _number(element, name) for name in names if name in element.attrib}
    for name, number in tuple(given.items()):
        if number == _CARLA_DEFAULT and name not in _WEATHER_RANGES:
            del given[name]
            continue
        low, high = _WEATHER_RANGES.get(name, (0.0, 100.0))
        if not low <= number <= high:
            raise RouteError(f"<weather> has {name}={number:g}, expected {low:g} to {high:g}")
    return Weather(**given)


def _number(element: ElementTree.Element, name: str) -> float:
    text = element.get(name)
    number = None if text is None else _finite(text)
    if number is None:
        raise RouteError(f"<{element.tag}> has {name}={text!r}, expected a finite number")
    return number


def _finite(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
