"""Read and write route files in the CARLA leaderboard's XML schema; `route_element` reads one of their routes.

Schema: Bench2Drive `leaderboard/data/*.xml`: `routes > route[id, town]` with `waypoints > position[x y z]`,
`scenarios > scenario[name, type]` with `trigger_point[x y z yaw]` and parameter elements, `weathers > weather`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path

from pytest_drive_robust.domain.route import Route, ScenarioSpec, Weather
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.route_element import no_such_name, read_route
from pytest_drive_robust.simulators.embedded.traced.scenario_problems import problems_of
from pytest_drive_robust.simulators.embedded.traced.schema import SCHEMA, is_carla, is_traced


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
        raise RouteError(f"{path}: {no_such_name('routes', 'element', strange, ('route',))}")
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
            route = read_route(element)
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
