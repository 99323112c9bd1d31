"""Styles without junctions: streets, avenues, a bend, a country road, a motorway."""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.simulators.embedded.towns.pieces import road, winding
from pytest_drive_robust.simulators.embedded.towns.town import Section, Town

__all__ = [
    "avenue",
    "bend",
    "highway",
    "one_way_street",
    "parking_avenue",
    "parking_street",
    "rural_road",
    "street",
]

_START = (-100.0, 0.0, 0.0)
_COUNTRY_GAP_M = (8.0, 30.0)


def street(town: Town, rng: RandomNumbers) -> None:
    """Draw a two-way street, one lane each way, straight or winding, with sidewalks."""
    section = Section(1, 1, rng.uniform(3.4, 3.8), rng.choice([11.0, 12.5, 13.9]))
    pieces = [(320.0, 0.0)] if rng.random() < 0.4 else winding(rng, 320.0, radius_m=(90.0, 160.0))
    road(town, "road", _START, pieces, section)


def parking_street(town: Town, rng: RandomNumbers) -> None:
    """Draw a two-way street, one lane each way, with parking lanes and sidewalks."""
    section = Section(1, 1, rng.uniform(3.4, 3.7), rng.choice([11.0, 12.5]), parking=True)
    pieces = [(320.0, 0.0)] if rng.random() < 0.6 else winding(rng, 320.0, radius_m=(110.0, 180.0))
    road(town, "road", _START, pieces, section)


def avenue(town: Town, rng: RandomNumbers) -> None:
    """Draw a two-way avenue, two lanes each way, with sidewalks."""
    section = Section(2, 2, rng.uniform(3.3, 3.6), rng.choice([12.5, 13.9]))
    pieces = [(340.0, 0.0)] if rng.random() < 0.5 else winding(rng, 340.0, radius_m=(130.0, 220.0))
    road(town, "road", _START, pieces, section)


def parking_avenue(town: Town, rng: RandomNumbers) -> None:
    """Draw a two-way avenue, two lanes each way, with parking lanes and sidewalks."""
    section = Section(2, 2, rng.uniform(3.3, 3.6), rng.choice([12.5, 13.9]), parking=True)
    pieces = [(340.0, 0.0)] if rng.random() < 0.5 else winding(rng, 340.0, radius_m=(140.0, 230.0))
    road(town, "road", _START, pieces, section)


def one_way_street(town: Town, rng: RandomNumbers) -> None:
    """Draw two lanes, one way, parking on the right, sidewalks on both sides."""
    width, speed = rng.uniform(3.2, 3.6), rng.choice([11.0, 12.5])
    section = Section(2, 0, width, speed, parking=True, left_walk=True)
    pieces = [(320.0, 0.0)] if rng.random() < 0.5 else winding(rng, 320.0, radius_m=(110.0, 180.0))
    road(town, "road", _START, pieces, section)


def bend(town: Town, rng: RandomNumbers) -> None:
    """Draw a two-way road with one tight bend: you see late who comes round it."""
    section = Section(1, 1, rng.uniform(3.4, 3.7), rng.choice([10.0, 11.0]))
    straight = rng.uniform(115.0, 130.0)
    radius, turn = rng.uniform(25.0, 45.0), math.radians(rng.uniform(70.0, 100.0))
    side = 1.0 if rng.random() < 0.5 else -1.0
    road(town, "road", _START, [(straight, 0.0), (radius * turn, side / radius), (straight, 0.0)], section)
    town.anchors.update({"road.f0": straight, "road.b0": straight})


def rural_road(town: Town, rng: RandomNumbers) -> None:
    """Draw a winding country road, one lane each way, no sidewalk, houses far apart."""
    section = Section(1, 1, rng.uniform(3.4, 3.6), rng.choice([16.0, 17.5, 19.0]), sidewalk=False)
    road(town, "road", _START, winding(rng, 460.0, radius_m=(150.0, 300.0), arc_m=(60.0, 90.0)), section)
    town.building_gap_m = _COUNTRY_GAP_M


def highway(town: Town, rng: RandomNumbers) -> None:
    """Draw one carriageway of a motorway: two lanes and an entry lane to their right."""
    speed = rng.choice([20.0, 22.0])
    pieces = [(520.0, 0.0)] if rng.random() < 0.5 else winding(rng, 520.0, radius_m=(300.0, 500.0))
    road(town, "road", (-120.0, 0.0, 0.0), pieces, Section(3, 0, rng.uniform(3.5, 3.75), speed, sidewalk=False))
    town.building_gap_m = _COUNTRY_GAP_M
