"""What the official ability tool asks a map for, made up so that it answers what our simulator saw.

The tool wants to know where the first junction of a route is, on a route file and on the OpenDRIVE maps of a CARLA
installation. Towns of the embedded simulator have no such map. So an exported route whose car came safely through its
first junction is written as a straight road with a junction at its start, every other one with a junction at its end:
the tool then counts the same routes as we do. The files are for that tool only: nothing can be driven on them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping

from pytest_drive_robust.domain.result import EpisodeResult

MAPS_FOLDER = ("CarlaUE4", "Content", "Carla", "Maps", "OpenDrive")
"""Below CARLA_ROOT."""
_LENGTH_M = 1000.0
_JUNCTION_M = 4.0
TOWNS: Mapping[str, float] = {"JunctionAtStart": 4.0, "JunctionAtEnd": _LENGTH_M - _JUNCTION_M - 3.0}
"""Each made-up town with the metre where its junction begins."""


def routes_text(results: Iterable[EpisodeResult]) -> str:
    """Return the route file to give to the tool with `-f`."""
    root = ElementTree.Element("routes")
    start, end = TOWNS
    for result in results:
        town = start if result.junction_passed else end
        route = ElementTree.SubElement(root, "route", id=result.episode.route_id, town=town)
        waypoints = ElementTree.SubElement(route, "waypoints")
        for x_m in (1.0, _LENGTH_M - 1.0):
            ElementTree.SubElement(waypoints, "position", x=f"{x_m}", y="1.75", z="0.0")
        names = {"name": f"{result.scenario}_1", "type": result.scenario}
        scenario = ElementTree.SubElement(ElementTree.SubElement(route, "scenarios"), "scenario", names)
        ElementTree.SubElement(scenario, "trigger_point", x="1.0", y="1.75", z="0.0", yaw="0.0")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def map_text(town: str) -> str:
    """Return the OpenDRIVE map of a made-up town: one lane from x = 0 to 1000 m."""
    begin_m = TOWNS[town]
    root = ElementTree.Element("OpenDRIVE")
    ElementTree.SubElement(root, "header", revMajor="1", revMinor="4", name=town, version="1")
    _road(root, 1, 0.0, begin_m, junction=-1, before=None, after=("junction", 100))
    _road(root, 2, begin_m, _JUNCTION_M, junction=100, before=("road", 1), after=("road", 3))
    rest_m = _LENGTH_M - begin_m - _JUNCTION_M
    _road(root, 3, begin_m + _JUNCTION_M, rest_m, junction=-1, before=("junction", 100), after=None)
    junction = ElementTree.SubElement(root, "junction", id="100", name="junction")
    way = {"id": "0", "incomingRoad": "1", "connectingRoad": "2", "contactPoint": "start"}
    ElementTree.SubElement(ElementTree.SubElement(junction, "connection", way), "laneLink", {"from": "-1", "to": "-1"})
    return ElementTree.tostring(root, encoding="unicode") + "\n"


_Link = tuple[str, int] | None


def _road(
    root: ElementTree.Element,
    number: int,
    begin_m: float,
    length_m: float,
    *,
    junction: int,
    before: _Link,
    after: _Link,
) -> None:
    """Add a straight road with one driving lane to the right of its reference line."""
    length = f"{length_m}"
    given = {"name": f"road {number}", "length": length, "id": f"{number}", "junction": f"{junction}"}
    road = ElementTree.SubElement(root, "road", given)
    links = ElementTree.SubElement(road, "link")
    for name, link, contact in (("predecessor", before, "end"), ("successor", after, "start")):
        if link is not None:
            at = {"elementType": link[0], "elementId": f"{link[1]}"}
            ElementTree.SubElement(links, name, at | ({"contactPoint": contact} if link[0] == "road" else {}))
    plan = ElementTree.SubElement(road, "planView")
    at = {"s": "0.0", "x": f"{begin_m}", "y": "0.0", "hdg": "0.0", "length": length}
    ElementTree.SubElement(ElementTree.SubElement(plan, "geometry", at), "line")
    ElementTree.SubElement(ElementTree.SubElement(road, "elevationProfile"), "elevation", _cubic())
    section = ElementTree.SubElement(ElementTree.SubElement(road, "lanes"), "laneSection", s="0.0")
    centre = ElementTree.SubElement(section, "center")
    middle = ElementTree.SubElement(centre, "lane", id="0", type="none", level="false")
    lane = ElementTree.SubElement(
        ElementTree.SubElement(section, "right"), "lane", id="-1", type="driving", level="false"
    )
    lane_links = ElementTree.SubElement(lane, "link")
    for name, link in (("predecessor", before), ("successor", after)):
        if link is not None and link[0] == "road":
            ElementTree.SubElement(lane_links, name, id="-1")
    ElementTree.SubElement(lane, "width", {"sOffset": "0.0", **_cubic(3.5, place=False)})
    mark = {"sOffset": "0.0", "type": "solid", "material": "standard", "color": "white", "laneChange": "none"}
    for marked in (middle, lane):
        ElementTree.SubElement(marked, "roadMark", mark)


def _cubic(a: float = 0.0, *, place: bool = True) -> dict[str, str]:
    return ({"s": "0.0"} if place else {}) | {"a": f"{a}", "b": "0.0", "c": "0.0", "d": "0.0"}
