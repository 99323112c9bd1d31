"""Route files in the CARLA leaderboard's XML schema: reading and writing.

Schema: Bench2Drive `leaderboard/data/*.xml`: `routes > route[id, town]` with `waypoints > position[x y z]`,
`scenarios > scenario[name, type]` with `trigger_point[x y z yaw]` and parameter elements, `weathers > weather`.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint, Waypoint, Weather
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.traced.schema import (
    SCHEMA,
    is_carla,
    is_numeric,
    is_traced,
    nearest_hint,
    problems_of,
)

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
"""The known attributes and elements of each element; scenario elements are checked elsewhere."""
_CARLA_DEFAULT = -1.0
"""A percentage of -1 leaves the choice to CARLA; we then use our default."""


def load_routes(path: Path, *, is_ours: bool = False) -> tuple[Route, ...]:
    """Return every route of a file, in file order; `is_ours` reads a file that we ship, faster, without attack checks.

    Raises one `RouteError` that names the file and, for every route with a mistake, the route and the element. For
    roads that are built around the waypoints, the needs of the scenario type are checked, too. After any mistake, all
    other routes are also test-built, so that one reading reports everything. On towns that are not CARLA's, elements
    and attributes that we do not read are refused; leaderboard files may have some that only CARLA reads.

    A route has one weather. If a leaderboard file gives several weathers, the route takes the weather of its start, the
    lowest `route_percentage`; on other towns all weathers of a route must be equal.
    """
    from defusedxml.common import DefusedXmlException
    from defusedxml.ElementTree import parse

    try:
        root = ElementTree.parse(path).getroot() if is_ours else parse(path, forbid_dtd=True).getroot()
    except FileNotFoundError:
        raise RouteError(f"there is no route file {str(path)!r}") from None
    except OSError as error:
        raise RouteError(f"cannot read route file {str(path)!r}: {error}") from None
    except (ElementTree.ParseError, DefusedXmlException, UnicodeError, ValueError) as error:
        raise RouteError(f"{path}: not a route XML file: {error}") from None
    if root.tag != "routes":
        raise RouteError(f"{path}: the outermost element is <{root.tag}>, expected <routes>")
    elements = root.findall("route")
    if not elements:
        raise RouteError(f"{path}: holds no <route>")
    strange = next((child.tag for child in root if child.tag != "route"), None)
    if strange is not None and not any(is_carla(element.get("town", "")) for element in elements):
        raise RouteError(f"{path}: {_no_such('routes', 'element', strange, ('route',))}")
    routes, problems = _read(elements)
    if problems:
        problems += [problem for route in routes if (problem := _misfit(route)) is not None]
        several = f"{len(problems)} of {len(elements)} routes cannot be read:\n  "
        raise RouteError(f"{path}: {several if len(problems) > 1 else ''}" + "\n  ".join(problems))
    return tuple(routes)


def _read(elements: list[ElementTree.Element]) -> tuple[list[Route], list[str]]:
    """Return the routes without a mistake, and one line of text for each other route."""
    routes: list[Route] = []
    problems: list[str] = []
    seen: set[str] = set()
    for element in elements:
        try:
            route = _route(element)
        except RouteError as error:
            problems.append(str(error))
            continue
        wrong = _wrong_elements(route)
        if wrong:
            problems.append(f"route {route.id}: {'; '.join(wrong)}")
        elif route.id in seen:
            problems.append(f"two routes have the id {route.id!r}")
        else:
            seen.add(route.id)
            routes.append(route)
    return routes, problems


def _wrong_elements(route: Route) -> list[str]:
    traced = is_traced(route.town)
    if not traced and route.scenario.type not in SCHEMA:
        return []  # the world that drives this town may know more scenario types, and checks them
    return problems_of(route.scenario, strict=not is_carla(route.town), placed=traced)


def _misfit(route: Route) -> str | None:
    """Return why no road can be built around a route of the leaderboard, or None."""
    from pytest_drive_robust.simulators.embedded.traced.traced_route import trace_route  # loads numba

    if is_traced(route.town):
        try:
            trace_route(route)
        except RouteError as error:
            return str(error)
    return None


def save_routes(routes: Iterable[Route], path: Path) -> None:
    """Write a route file that `load_routes` reads back to equal routes."""
    root = ElementTree.Element("routes")
    for route in routes:
        element = ElementTree.SubElement(root, "route", id=route.id, town=route.town)
        waypoints = ElementTree.SubElement(element, "waypoints")
        for point in route.waypoints:
            ElementTree.SubElement(waypoints, "position", x=repr(point.x_m), y=repr(point.y_m), z=repr(point.z_m))
        _write_scenario(ElementTree.SubElement(element, "scenarios"), route.scenario)
        weathers = ElementTree.SubElement(element, "weathers")
        values = {field.name: repr(getattr(route.weather, field.name)) for field in fields(Weather)}
        for share in ("0", "100"):
            ElementTree.SubElement(weathers, "weather", {"route_percentage": share, **values})
    ElementTree.indent(root)
    path.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8")


def _write_scenario(parent: ElementTree.Element, scenario: ScenarioSpec) -> None:
    element = ElementTree.SubElement(parent, "scenario", name=scenario.name, type=scenario.type)
    at = scenario.trigger
    ElementTree.SubElement(
        element, "trigger_point", x=repr(at.x_m), y=repr(at.y_m), z=repr(at.z_m), yaw=repr(at.yaw_deg)
    )
    for name, attributes in scenario.parameters.items():
        ElementTree.SubElement(element, name, {key: repr(value) for key, value in attributes.items()})
    for name, text in scenario.texts.items():
        ElementTree.SubElement(element, name, value=text)


def _route(element: ElementTree.Element) -> Route:
    route_id = element.get("id")
    if not route_id:
        raise RouteError("a <route> has no id")
    if route_id != route_id.strip() or _NOT_IN_IDS.intersection(route_id) or route_id.endswith(".xml"):
        raise RouteError(
            f"route {route_id!r}: --drive-routes could not name it. Give it an id without commas, colons and slashes, "
            "without blanks at its ends and without .xml"
        )
    where = f"route {route_id}"
    town = element.get("town")
    if not town:
        raise RouteError(f"{where}: <route> has no town")
    official = is_carla(town)
    unread = [] if official else list(_unread(element))
    if unread:
        raise RouteError(f"{where}: {'; '.join(unread)}")
    positions = element.findall("waypoints/position")
    waypoints = tuple(
        Waypoint(_number(p, "x", where), _number(p, "y", where), _number(p, "z", where)) for p in positions
    )
    if len(waypoints) < 2:
        raise RouteError(f"{where}: {len(waypoints)} waypoint(s), expected at least 2")
    scenarios = element.findall("scenarios/scenario")
    if len(scenarios) != 1:
        raise RouteError(f"{where}: {len(scenarios)} scenarios, expected exactly 1")
    scenario = _scenario(scenarios[0], where, strict=not official)
    return Route(route_id, town, waypoints, scenario, _weather(element, where, official=official))


def _unread(element: ElementTree.Element) -> Iterator[str]:
    """Yield a line for each unread name in an element and its children: unknown names, and elements given twice."""
    attributes, children = _NAMES.get(element.tag, (tuple(element.attrib), ()))
    if element.tag == "scenario":  # its known elements depend on the scenario type, and are checked elsewhere
        attributes, children = ("name", "type"), tuple(child.tag for child in element)
    for name in element.attrib:
        if name not in attributes:
            yield _no_such(element.tag, "attribute", name, attributes)
    for child in element:
        if child.tag in children:
            yield from _unread(child)
        else:
            yield _no_such(element.tag, "element", child.tag, children)
    if element.tag == "scenario":
        for name, times in Counter(child.tag for child in element).items():
            if times > 1:
                yield f"<{name}> stands {times} times in its scenario, expected once"


def _no_such(element: str, what: str, name: str, known: tuple[str, ...]) -> str:
    """Return the message that an element has no such name, with the nearest known name or the element it belongs in."""
    home = next((tag for tag, (_, children) in _NAMES.items() if what == "element" and name in children), None)
    hint = f": it belongs in <{home}>." if home else nearest_hint(name, known) or "."
    return f"<{element}> has no {what} {name!r}{hint} Known: {', '.join(known) or 'none'}"


def _scenario(element: ElementTree.Element, where: str, *, strict: bool) -> ScenarioSpec:
    """Read a scenario; `strict` keeps every numeric attribute, so that one without effect can be refused."""
    kind = element.get("type")
    if not kind:
        raise RouteError(f"{where}: <scenario> has no type")
    trigger = element.find("trigger_point")
    if trigger is None:
        raise RouteError(f"{where}: scenario {kind} has no <trigger_point>")
    at = TriggerPoint(*(_number(trigger, name, where) for name in ("x", "y", "z", "yaw")))
    parameters: dict[str, dict[str, float]] = {}
    texts: dict[str, str] = {}
    for child in element:
        if child.tag == "trigger_point":
            continue
        if strict and is_numeric(child.tag):
            parameters[child.tag] = {name: _number(child, name, where) for name in child.attrib}
            continue
        numbers = {name: number for name, text in child.attrib.items() if (number := _finite(text)) is not None}
        if numbers:
            parameters[child.tag] = numbers
        elif "value" in child.attrib:
            texts[child.tag] = child.attrib["value"]
        elif strict:
            texts[child.tag] = ""
    return ScenarioSpec(element.get("name") or f"{kind}_1", kind, at, parameters, texts)


def _weather(element: ElementTree.Element, where: str, *, official: bool) -> Weather:
    found = []
    for each in element.findall("weathers/weather"):
        share = _number(each, _SHARE, where) if _SHARE in each.attrib else 0.0
        found.append((share, _one_weather(each, where, official=official)))
    if not found:
        return Weather()
    if not official and len({weather for _, weather in found}) > 1:
        raise RouteError(
            f"{where}: its {len(found)} <weather> elements differ, but the weather of a route does not change: keep "
            "one, or give all of them the same values"
        )
    return min(found, key=lambda one: one[0])[1]


def _one_weather(element: ElementTree.Element, where: str, *, official: bool) -> Weather:
    names = [field.name for field in fields(Weather)]
    for name in element.attrib:
        if name not in (*names, _SHARE, *(_OF_CARLA if official else ())):
            raise RouteError(f"{where}: {_no_such('weather', 'attribute', name, (_SHARE, *names))}")
    given = {name: _number(element, name, where) for name in names if name in element.attrib}
    for name, number in tuple(given.items()):
        if number == _CARLA_DEFAULT and name not in _WEATHER_RANGES:
            del given[name]
            continue
        low, high = _WEATHER_RANGES.get(name, (0.0, 100.0))
        if not low <= number <= high:
            raise RouteError(f"{where}: <weather> has {name}={number:g}, expected {low:g} to {high:g}")
    return Weather(**given)


def _number(element: ElementTree.Element, name: str, where: str) -> float:
    text = element.get(name)
    number = None if text is None else _finite(text)
    if number is None:
        raise RouteError(f"{where}: <{element.tag}> has {name}={text!r}, expected a finite number")
    return number


def _finite(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
