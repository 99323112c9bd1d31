"""The towns: small maps, each style one function that draws roads.

A town is named `<Style><number>`; the number seeds its proportions, so `Street7` is the same town in every process.
"""

from __future__ import annotations

import re

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.errors import RouteError, UnknownNameError
from pytest_drive_robust.simulators.embedded.towns import crossings, streets
from pytest_drive_robust.simulators.embedded.towns.town import Draw, Town

__all__ = ["STYLES", "Town", "build_town"]

STYLES: dict[str, Draw] = {
    "Street": streets.street(
        1, 1, width_m=(3.4, 3.8), limits_mps=[11.0, 12.5, 13.9], length_m=320.0, straight=0.4, radius_m=(90.0, 160.0)
    ),
    "ParkingStreet": streets.street(
        1, 1, width_m=(3.4, 3.7), limits_mps=[11.0, 12.5], length_m=320.0, straight=0.6, radius_m=(110.0, 180.0),
        parking=True,
    ),
    "Avenue": streets.street(
        2, 2, width_m=(3.3, 3.6), limits_mps=[12.5, 13.9], length_m=340.0, straight=0.5, radius_m=(130.0, 220.0)
    ),
    "ParkingAvenue": streets.street(
        2, 2, width_m=(3.3, 3.6), limits_mps=[12.5, 13.9], length_m=340.0, straight=0.5, radius_m=(140.0, 230.0),
        parking=True,
    ),
    "OneWayStreet": streets.street(
        2, 0, width_m=(3.2, 3.6), limits_mps=[11.0, 12.5], length_m=320.0, straight=0.5, radius_m=(110.0, 180.0),
        parking=True, left_walk=True,
    ),
    "Bend": streets.bend,
    "RuralRoad": streets.rural_road,
    "Highway": streets.highway,
    "EntryRamp": streets.entry_ramp,
    "ExitRamp": streets.exit_ramp,
    "LightCrossing": crossings.crossing("light", lanes=1),
    "LightAvenueCrossing": crossings.crossing("light", lanes=2),
    "StopCrossing": crossings.crossing("stop", lanes=1),
    "OpenCrossing": crossings.crossing(None, lanes=1),
    "RuralCrossing": crossings.rural("ESWN", {"N": "stop", "S": "stop"}),
    "BikeCrossing": crossings.bike_crossing,
    "LightTee": crossings.tee(dict.fromkeys("ESW", "light")),
    "StopTee": crossings.tee({"S": "stop"}),
    "OpenTee": crossings.tee({}),
    "RuralTee": crossings.rural("ESW", {}),
    "Roundabout": crossings.roundabout,
    "Grid": crossings.grid,
}  # fmt: skip
"""Every style of town by name."""


def build_town(name: str) -> Town:
    """Draw the town `<Style><number>`. Raises `RouteError` or `UnknownNameError` for any other name."""
    match = re.fullmatch(r"([A-Za-z]+)(\d{1,6})", name)
    if match is None:
        raise RouteError(
            f"town {name!r} is none of ours: expected a style and a number such as 'Street1', or "
            f"'Town' and a number for a polyline of your own. Styles: {', '.join(sorted(STYLES))}."
        )
    style, number = match[1], int(match[2])
    if style not in STYLES:
        raise UnknownNameError.of("town style", style, STYLES)
    town = Town(name)
    STYLES[style](town, RandomNumbers((number, 0x70776E)))
    return town
