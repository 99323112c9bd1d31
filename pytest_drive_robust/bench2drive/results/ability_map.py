"""Made-up maps and routes for the official ability tool, which make it count what our simulator saw.

The tool looks up the first junction of a route, from a route file and the OpenDRIVE maps of a CARLA installation. Towns
of the embedded simulator have no such map. So an exported route whose car came safely through its first junction is
written as a straight road with a junction at the start, every other route with a junction at the end: the tool then
counts the same routes as we do. The files are for that tool only: nothing can be driven on them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from itertools import pairwise

import numpy as np

from pytest_drive_robust.bench2drive.agents.opendrive import opendrive_of
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.truth import Lane, LaneKind, LaneMap

MAPS_FOLDER = ("CarlaUE4", "Content", "Carla", "Maps", "OpenDrive")
"""The folder of the maps below CARLA_ROOT."""
_LENGTH_M = 1000.0
_JUNCTION_M = 4.0
_ASIDE_M = 1.75
"""The lane lies to the right of the x axis."""
_ROWS = 9
TOWNS: Mapping[str, float] = {"JunctionAtStart": 4.0, "JunctionAtEnd": _LENGTH_M - _JUNCTION_M - 3.0}
"""Each made-up town with the metre where its junction begins."""


def routes_text(results: Iterable[EpisodeResult]) -> str:
    """Return the text of the route file for the tool's option `-f`."""
    root = ElementTree.Element("routes")
    start, end = TOWNS
    for result in results:
        town = start if result.junction_passed else end
        route = ElementTree.SubElement(root, "route", id=result.episode.route_id, town=town)
        waypoints = ElementTree.SubElement(route, "waypoints")
        for x_m in (1.0, _LENGTH_M - 1.0):
            ElementTree.SubElement(waypoints, "position", x=f"{x_m}", y=f"{_ASIDE_M}", z="0.0")
        names = {"name": f"{result.scenario}_1", "type": result.scenario}
        scenario = ElementTree.SubElement(ElementTree.SubElement(route, "scenarios"), "scenario", names)
        ElementTree.SubElement(scenario, "trigger_point", x="1.0", y=f"{_ASIDE_M}", z="0.0", yaw="0.0")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def map_text(town: str) -> str:
    """Return the OpenDRIVE map of a made-up town: one lane from x = 0 to 1000 m."""
    begin_m = TOWNS[town]
    ends_m = (0.0, begin_m, begin_m + _JUNCTION_M, _LENGTH_M)
    lanes = tuple(
        Lane(
            index=number,
            kind=LaneKind.DRIVING,
            centre=np.column_stack((np.linspace(start_m, end_m, _ROWS), np.full(_ROWS, _ASIDE_M), np.zeros(_ROWS))),
            width_m=2.0 * _ASIDE_M,
            speed_limit_mps=13.9,
            junction=number == 2,
            left=-1,
            right=-1,
            left_same_way=False,
            right_same_way=False,
            left_line="solid",
            right_line="solid",
            successors=(number + 1,) if number < 3 else (),
        )
        for number, (start_m, end_m) in enumerate(pairwise(ends_m), start=1)
    )
    return opendrive_of(LaneMap(town, lanes, (), np.zeros((0, 4, 2)), np.zeros((0, 6)))) + "\n"
