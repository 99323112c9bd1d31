"""Styles without junctions: streets, avenues, a bend, a country road, motorways with entry or exit."""

from __future__ import annotations

import math
from dataclasses import replace
from math import fsum

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers, Range
from pytest_drive_robust.simulators.embedded.geometry import Pose, moved
from pytest_drive_robust.simulators.embedded.towns.pieces import Piece, retreat, road, winding
from pytest_drive_robust.simulators.embedded.towns.town import Draw, Section, Town

_START = (-100.0, 0.0, 0.0)
_COUNTRY_GAP_M = (8.0, 30.0)
_WIDTH_M = 3.6
_MOTORWAY_START: Pose = (-200.0, 0.0, 0.0)
_BEFORE_M, _AFTER_M = 200.0, 300.0
_EXIT_LANE_M = 280.0
_GAP_M = (14.0, 35.0)
"""Gap of buildings, wide enough that merging traffic sees the road."""


def street(
    forward: int, backward: int, *, width_m: Range, limits_mps: list[float], length_m: float, straight: float,
    radius_m: Range, parking: bool = False, left_walk: bool = False,
) -> Draw:  # fmt: skip
    """Return a style: a street in town with sidewalks; the share `straight` of its towns is straight, others wind."""

    def draw(town: Town, rng: RandomNumbers) -> None:
        width, limit = rng.uniform(*width_m), rng.choice(limits_mps)
        section = Section(forward, backward, width, limit, parking=parking, left_walk=left_walk)
        pieces = [(length_m, 0.0)] if rng.random() < straight else winding(rng, length_m, radius_m=radius_m)
        road(town, "road", _START, pieces, section)

    return draw


def bend(town: Town, rng: RandomNumbers) -> None:
    """Draw a two-way road with one tight bend, where oncoming traffic is seen late."""
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


def entry_ramp(town: Town, rng: RandomNumbers) -> None:
    """Draw two or three lanes and a ramp that becomes an acceleration lane, which ends."""
    lanes, limit, ramp = _draw(rng)
    parallel_m = rng.uniform(90.0, 140.0)
    section = Section(lanes, 0, _WIDTH_M, limit, sidewalk=False)
    merge: Pose = road(town, "road", _MOTORWAY_START, [(_BEFORE_M, 0.0)], section)
    wide = replace(section, forward=lanes + 1)
    after = road(town, "road", merge, [(parallel_m, 0.0)], wide)
    road(town, "road", after, [(_AFTER_M, 0.0)], section)
    acceleration = town.chains.pop(f"road.f{lanes}")
    pieces = _ramp(rng)
    start = retreat(moved(merge, 0.0, lanes * _WIDTH_M), pieces)
    road(town, "ramp", start, pieces, Section(1, 0, _WIDTH_M, ramp, sidewalk=False))
    town.chains["ramp.f0"] += acceleration
    town.anchors["ramp.f0"] = fsum(town.lanes[k].length_m for k in town.chains["ramp.f0"]) - parallel_m
    _name_lanes(town, lanes, _BEFORE_M)


def exit_ramp(town: Town, rng: RandomNumbers) -> None:
    """Draw two or three lanes and an exit lane to their right, which parts from the road."""
    lanes, limit, ramp = _draw(rng)
    section = Section(lanes, 0, _WIDTH_M, limit, sidewalk=False)
    gore = road(town, "road", _MOTORWAY_START, [(_EXIT_LANE_M, 0.0)], replace(section, forward=lanes + 1))
    road(town, "road", gore, [(_AFTER_M, 0.0)], section)
    town.chains["exit.f0"] = town.chains.pop(f"road.f{lanes}")
    pieces = list(reversed(_ramp(rng)))
    road(town, "exit", moved(gore, 0.0, lanes * _WIDTH_M), pieces, Section(1, 0, _WIDTH_M, ramp, sidewalk=False))
    town.anchors["exit.f0"] = _EXIT_LANE_M
    _name_lanes(town, lanes, _EXIT_LANE_M)


def _draw(rng: RandomNumbers) -> tuple[int, float, float]:
    """Return lanes, speed limit of the road, of the ramp."""
    return 2 + rng.below(2), rng.choice([20.0, 22.0, 25.0]), rng.uniform(14.0, 17.0)


def _ramp(rng: RandomNumbers) -> list[Piece]:
    """Return a straight and an arc to the right of 15 to 25 degrees that ends parallel to the road."""
    radius, turn = rng.uniform(170.0, 230.0), rng.uniform(0.27, 0.42)
    return [(rng.uniform(140.0, 160.0), 0.0), (radius * turn, 1.0 / radius)]


def _name_lanes(town: Town, lanes: int, anchor_m: float) -> None:
    town.chains["road.right"] = list(town.chains[f"road.f{lanes - 1}"])
    town.anchors.update({name: anchor_m for name in town.chains if name.startswith("road.")})
    town.building_gap_m = _GAP_M
