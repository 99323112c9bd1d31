"""The towns: small maps written with highway-env's road network and lane classes.

A town is named `<Style><number>`; the number seeds its proportions, so `Street7` is the same town in every process.
Each style is one function that draws roads. highway-env knows no lane kinds, junctions, stop lines or buildings:
`Town` notes them beside the network.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.errors import RouteError, UnknownNameError
from pytest_drive_robust.simulators.embedded.towns import crossings, motorways, streets
from pytest_drive_robust.simulators.embedded.towns.grid import grid
from pytest_drive_robust.simulators.embedded.towns.roundabout import roundabout
from pytest_drive_robust.simulators.embedded.towns.town import Arm, JunctionControl, LaneKey, Town

__all__ = ["STYLES", "Arm", "JunctionControl", "LaneKey", "Town", "build_town"]

STYLES: dict[str, Callable[[Town, RandomNumbers], None]] = {
    "Street": streets.street,
    "ParkingStreet": streets.parking_street,
    "Avenue": streets.avenue,
    "ParkingAvenue": streets.parking_avenue,
    "OneWayStreet": streets.one_way_street,
    "Bend": streets.bend,
    "RuralRoad": streets.rural_road,
    "Highway": streets.highway,
    "EntryRamp": motorways.entry_ramp,
    "ExitRamp": motorways.exit_ramp,
    "LightCrossing": crossings.crossing("light", lanes=1),
    "LightAvenueCrossing": crossings.crossing("light", lanes=2),
    "StopCrossing": crossings.crossing("stop", lanes=1),
    "OpenCrossing": crossings.crossing(None, lanes=1),
    "RuralCrossing": crossings.rural_crossing,
    "BikeCrossing": crossings.bike_crossing,
    "LightTee": crossings.tee(dict.fromkeys("ESW", "light")),
    "StopTee": crossings.tee({"S": "stop"}),
    "OpenTee": crossings.tee({}),
    "RuralTee": crossings.rural_tee,
    "Roundabout": roundabout,
    "Grid": grid,
}
"""Every style of town by name."""


def build_town(name: str) -> Town:
    """Draw the town `<Style><number>`. Raises `RouteError` or `UnknownNameError` for any other name."""
    match = re.fullmatch(r"([A-Za-z]+)(\d{1,6})", name)
    if match is None:
        raise RouteError(
            f"town {name!r} is none of ours: expected a style and a number such as 'Street1'. "
            f"Styles: {', '.join(sorted(STYLES))}."
        )
    style, number = match[1], int(match[2])
    if style not in STYLES:
        raise UnknownNameError.of("town style", style, STYLES)
    town = Town(name)
    STYLES[style](town, RandomNumbers((number, 0x70776E)))
    return town
