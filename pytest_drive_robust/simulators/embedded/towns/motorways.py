"""Motorways where one gets on or off."""

from __future__ import annotations

from dataclasses import replace
from math import fsum

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.simulators.embedded.towns.pieces import Piece, beside, retreat, road
from pytest_drive_robust.simulators.embedded.towns.town import Pose, Section, Town

__all__ = ["entry_ramp", "exit_ramp"]

_WIDTH_M = 3.6
_START: Pose = (-200.0, 0.0, 0.0)
_BEFORE_M, _AFTER_M = 200.0, 300.0
_EXIT_LANE_M = 280.0
_GAP_M = (14.0, 35.0)
"""Who merges must see who comes."""


def entry_ramp(town: Town, rng: RandomNumbers) -> None:
    """Draw two or three lanes and a ramp that becomes an acceleration lane, which ends."""
    lanes, limit, ramp = _draw(rng)
    parallel_m = rng.uniform(90.0, 140.0)
    section = Section(lanes, 0, _WIDTH_M, limit, sidewalk=False)
    merge: Pose = road(town, "road", _START, [(_BEFORE_M, 0.0)], section)
    wide = replace(section, forward=lanes + 1)
    after = road(town, "road", merge, [(parallel_m, 0.0)], wide, first=1)
    road(town, "road", after, [(_AFTER_M, 0.0)], section, first=2)
    acceleration = town.chains.pop(f"road.f{lanes}")
    pieces = _ramp(rng)
    start = retreat(beside(merge, lanes * _WIDTH_M), pieces)
    road(town, "ramp", start, pieces, Section(1, 0, _WIDTH_M, ramp, sidewalk=False))
    town.chains["ramp.f0"] += acceleration
    town.anchors["ramp.f0"] = _length(town, "ramp.f0") - parallel_m
    _name_lanes(town, lanes, _BEFORE_M)


def exit_ramp(town: Town, rng: RandomNumbers) -> None:
    """Draw two or three lanes and an exit lane to their right, which parts from the road."""
    lanes, limit, ramp = _draw(rng)
    section = Section(lanes, 0, _WIDTH_M, limit, sidewalk=False)
    gore = road(town, "road", _START, [(_EXIT_LANE_M, 0.0)], replace(section, forward=lanes + 1))
    road(town, "road", gore, [(_AFTER_M, 0.0)], section, first=1)
    town.chains["exit.f0"] = town.chains.pop(f"road.f{lanes}")
    pieces = list(reversed(_ramp(rng)))
    road(town, "exit", beside(gore, lanes * _WIDTH_M), pieces, Section(1, 0, _WIDTH_M, ramp, sidewalk=False))
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


def _length(town: Town, chain: str) -> float:
    return fsum(town.network.get_lane(key).length for key in town.chains[chain])
