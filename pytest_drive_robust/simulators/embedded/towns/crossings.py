"""Crossings of four arms and junctions of three, in town and in the country."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.simulators.embedded.towns.junction import chains_through, connect, draw_arms
from pytest_drive_robust.simulators.embedded.towns.pieces import piece
from pytest_drive_robust.simulators.embedded.towns.road_library import LineType
from pytest_drive_robust.simulators.embedded.towns.town import Arm, Section, Town

__all__ = ["bike_crossing", "crossing", "rural_crossing", "rural_tee", "tee"]

Draw = Callable[[Town, RandomNumbers], None]
_HEADINGS = {name: k * math.pi / 2.0 for k, name in enumerate("ESWN")}
_TOWN_LIMITS_MPS = [10.0, 11.0, 12.5]
_COUNTRY_LIMITS_MPS = [16.0, 17.5, 19.0]
_ARM_M = 110.0
_COUNTRY_ARM_M = 170.0


def crossing(control: str | None, *, lanes: int) -> Draw:
    """Return a style: a crossing of four arms in town, the same control at every entry."""

    def draw(town: Town, rng: RandomNumbers) -> None:
        width = rng.uniform(3.4, 3.7)
        section = Section(lanes, lanes, width, rng.choice(_TOWN_LIMITS_MPS))
        box = lanes * width + rng.uniform(5.0, 8.0)
        _junction(town, "ESWN", box, section, control={} if control is None else dict.fromkeys("ESWN", control))

    draw.__doc__ = f"A crossing of four arms, {lanes} lane(s) each way, {control or 'no'} control."
    return draw


def tee(control: dict[str, str]) -> Draw:
    """Return a style: a through road from W to E in town and a stem from S; `control` by arm."""

    def draw(town: Town, rng: RandomNumbers) -> None:
        width = rng.uniform(3.4, 3.7)
        section = Section(1, 1, width, rng.choice(_TOWN_LIMITS_MPS))
        _junction(town, "ESW", width + rng.uniform(5.0, 8.0), section, control=control)
        _close_sidewalk(town)

    draw.__doc__ = f"A junction of three arms, one lane each way, {control or 'no'} control."
    return draw


def bike_crossing(town: Town, rng: RandomNumbers) -> None:
    """Draw a crossing with lights and biking lanes that go straight over."""
    width, biking = rng.uniform(3.4, 3.7), rng.uniform(1.5, 1.8)
    section = Section(1, 1, width, rng.choice(_TOWN_LIMITS_MPS), biking_m=biking)
    box = width + biking + rng.uniform(5.0, 7.0)
    _junction(town, "ESWN", box, section, control=dict.fromkeys("ESWN", "light"))


def rural_tee(town: Town, rng: RandomNumbers) -> None:
    """Draw a fast country road from W to E and a slower stem from S, nothing controlled, wide turns."""
    _rural(town, rng, "ESW", control={})


def rural_crossing(town: Town, rng: RandomNumbers) -> None:
    """Draw a fast country road from W to E, crossed by a slower one with stop signs."""
    _rural(town, rng, "ESWN", control={"N": "stop", "S": "stop"})


def _rural(town: Town, rng: RandomNumbers, names: str, *, control: dict[str, str]) -> None:
    width = rng.uniform(3.45, 3.55)
    major = Section(1, 1, width, rng.choice(_COUNTRY_LIMITS_MPS), sidewalk=False)
    box = width + rng.uniform(8.5, 11.5)
    minor = replace(major, speed_mps=13.9)
    arms = [Arm(name, _HEADINGS[name], box, major if name in "EW" else minor) for name in names]
    draw_arms(town, arms, length_m=_COUNTRY_ARM_M, crosswalks=False)
    chains_through(town, connect(town, arms, controls=control))
    town.building_gap_m = (12.0, 35.0)


def _junction(town: Town, names: str, box_m: float, section: Section, *, control: dict[str, str]) -> None:
    arms = [Arm(name, _HEADINGS[name], box_m, section) for name in names]
    draw_arms(town, arms, length_m=_ARM_M)
    chains_through(town, connect(town, arms, controls=control))


def _close_sidewalk(town: Town) -> None:
    """Continue the sidewalk where a tee has no fourth arm."""
    before, after = town.chains["E.bwalk"][-1], town.chains["W.fwalk"][0]
    lane, onward = town.network.get_lane(before), town.network.get_lane(after)
    start, end = lane.position(lane.length, 0.0), onward.position(0.0, 0.0)
    pose = float(start[0]), float(start[1]), float(lane.heading_at(lane.length))
    drawn = piece(
        pose, scalars.hypot(*(end - start)), 0.0, 0.0, backward=False,
        width=lane.width_at(0.0), line_types=(LineType.NONE, LineType.NONE), speed_limit=lane.speed_limit,
    )  # fmt: skip
    town.add(before[1], after[0], drawn, kind=LaneKind.SIDEWALK)
