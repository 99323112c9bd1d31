"""Crossings of four arms and junctions of three, in town and in the country, a grid of them, a roundabout."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.domain.truth import LaneKind
from pytest_drive_robust.simulators.embedded.geometry import moved
from pytest_drive_robust.simulators.embedded.towns import junction
from pytest_drive_robust.simulators.embedded.towns.pieces import PLAIN, piece, retreat, road
from pytest_drive_robust.simulators.embedded.towns.town import Arm, Draw, Section, Town

_QUARTER = math.pi / 2.0
_HEADINGS = {name: k * _QUARTER for k, name in enumerate("ESWN")}
_TOWN_LIMITS_MPS = [10.0, 11.0, 12.5]
_COUNTRY_LIMITS_MPS = [16.0, 17.5, 19.0]
_ARM_M = 110.0
_COUNTRY_ARM_M = 170.0
_SIZE = 2


def crossing(control: str | None, *, lanes: int) -> Draw:
    """Return a style: a crossing of four arms in town, the same control at every entry."""

    def draw(town: Town, rng: RandomNumbers) -> None:
        width = rng.uniform(3.4, 3.7)
        section = Section(lanes, lanes, width, rng.choice(_TOWN_LIMITS_MPS))
        box = lanes * width + rng.uniform(5.0, 8.0)
        _junction(town, "ESWN", box, section, control={} if control is None else dict.fromkeys("ESWN", control))

    return draw


def tee(control: dict[str, str]) -> Draw:
    """Return a style: a through road from W to E in town and a stem from S; `control` by arm."""

    def draw(town: Town, rng: RandomNumbers) -> None:
        width = rng.uniform(3.4, 3.7)
        section = Section(1, 1, width, rng.choice(_TOWN_LIMITS_MPS))
        _junction(town, "ESW", width + rng.uniform(5.0, 8.0), section, control=control)
        _close_sidewalk(town)

    return draw


def bike_crossing(town: Town, rng: RandomNumbers) -> None:
    """Draw a crossing with lights and biking lanes that go straight over."""
    width, biking = rng.uniform(3.4, 3.7), rng.uniform(1.5, 1.8)
    section = Section(1, 1, width, rng.choice(_TOWN_LIMITS_MPS), biking_m=biking)
    box = width + biking + rng.uniform(5.0, 7.0)
    _junction(town, "ESWN", box, section, control=dict.fromkeys("ESWN", "light"))


def rural(names: str, control: dict[str, str]) -> Draw:
    """Return a style: a fast country road from W to E and a slower one, wide turns; `control` by arm."""

    def draw(town: Town, rng: RandomNumbers) -> None:
        width = rng.uniform(3.45, 3.55)
        major = Section(1, 1, width, rng.choice(_COUNTRY_LIMITS_MPS), sidewalk=False)
        box = width + rng.uniform(8.5, 11.5)
        minor = replace(major, speed_mps=13.9)
        arms = [Arm(name, _HEADINGS[name], box, major if name in "EW" else minor) for name in names]
        junction.draw_arms(town, arms, length_m=_COUNTRY_ARM_M, crosswalks=False)
        junction.chains_through(town, junction.connect(town, arms, controls=control))
        town.building_gap_m = (12.0, 35.0)

    return draw


def _junction(town: Town, names: str, box_m: float, section: Section, *, control: dict[str, str]) -> None:
    arms = [Arm(name, _HEADINGS[name], box_m, section) for name in names]
    junction.draw_arms(town, arms, length_m=_ARM_M)
    junction.chains_through(town, junction.connect(town, arms, controls=control))


def _close_sidewalk(town: Town) -> None:
    """Close the gap in the sidewalk where a tee has no fourth arm."""
    lane, onward = town.lanes[town.chains["E.bwalk"][-1]], town.lanes[town.chains["W.fwalk"][0]]
    x, y, heading = (float(value) for value in lane.centre[-1])
    length = scalars.hypot(*(onward.centre[0, :2] - lane.centre[-1, :2]))
    drawn = piece((x, y, heading), length, 0.0, width_m=lane.width_m, lines=PLAIN, speed_mps=lane.speed_mps)
    town.add(replace(drawn, kind=LaneKind.SIDEWALK))


def grid(town: Town, rng: RandomNumbers) -> None:
    """Draw four crossings with lights, 75 to 95 m apart, one lane each way.

    Roads that lead out: `W0`, `W1` (row 0 lies in the north), `E0`, `E1`, `N0`, `N1` (column 0 lies in the west), `S0`,
    `S1`; between the crossings `H0`, `H1` lead east, `V0`, `V1` south. Chains: `W0.left0` turns left at its first
    crossing and then goes straight out of town, `W0.straight-left0` turns left at its second one.
    """
    width = rng.uniform(3.4, 3.7)
    section = Section(1, 1, width, rng.choice(_TOWN_LIMITS_MPS))
    box = width + rng.uniform(5.0, 8.0)
    apart = rng.uniform(75.0, 95.0), rng.uniform(75.0, 95.0)
    ways: dict[int, list[junction.Connection]] = {}
    junctions = [
        _arms(column, row, (column * apart[0], row * apart[1]), box, section)
        for column, row in product(range(_SIZE), repeat=2)
    ]
    between_m = {"H": apart[0] - 2.0 * box, "V": apart[1] - 2.0 * box}
    for arms in junctions:
        for arm in arms:
            if not arm.ends_here:
                road(town, arm.name, arm.edge(), [(between_m.get(arm.name[0], _ARM_M), 0.0)], arm.section)
            junction.crosswalk(town, arm)
    for arms in junctions:
        for made in junction.connect(town, arms, controls={arm.name: "light" for arm in arms}):
            ways.setdefault(town.chains[made.source.inward("0")][-1], []).append(made)
    _name_chains(town, ways)


def _arms(column: int, row: int, centre: tuple[float, float], box_m: float, section: Section) -> list[Arm]:
    """Return the arms of one crossing; a road between two crossings is drawn by the western or northern one."""
    last = _SIZE - 1
    roads = (
        (f"E{row}" if column == last else f"H{row}", False),
        (f"S{column}" if row == last else f"V{column}", False),
        (f"W{row}" if column == 0 else f"H{row}", column > 0),
        (f"N{column}" if row == 0 else f"V{column}", row > 0),
    )
    return [
        Arm(name, k * _QUARTER, box_m, section, centre, ends_here=ends_here)
        for k, (name, ends_here) in enumerate(roads)
    ]


def _name_chains(town: Town, ways: dict[int, list[junction.Connection]]) -> None:
    for side in "EWNS":
        for number in range(_SIZE):
            entry = town.chains[f"{side}{number}.b0"]
            for first in ways[entry[-1]]:
                through = [*entry, first.key, *town.chains[first.target.outward("0")]]
                town.chains[f"{side}{number}.{first.turn}0"] = _straight_out(town, ways, through)
                for second in ways.get(through[-1], ()):
                    chain = [*through, second.key, *town.chains[second.target.outward("0")]]
                    town.chains[f"{side}{number}.{first.turn}-{second.turn}0"] = _straight_out(town, ways, chain)


def _straight_out(town: Town, ways: dict[int, list[junction.Connection]], chain: list[int]) -> list[int]:
    """Prolong a chain straight on over every crossing to the edge of the town."""
    while chain[-1] in ways:
        onward = next(made for made in ways[chain[-1]] if made.turn == "straight")
        chain = [*chain, onward.key, *town.chains[onward.target.outward("0")]]
    return chain


def roundabout(town: Town, rng: RandomNumbers) -> None:
    """Draw a ring of 14 to 20 m radius with four arms; traffic in the ring has priority."""
    width, radius = rng.uniform(3.5, 3.8), rng.uniform(14.0, 20.0)
    bend = rng.uniform(11.0, 14.0)
    section = Section(1, 1, width, rng.choice([11.0, 12.5]))
    ring = _Ring(town, section, radius, bend, rng.uniform(7.0, 8.0))
    arms = [Arm(name, heading, ring.box_m, section) for name, heading in _HEADINGS.items()]
    junction.draw_arms(town, arms, length_m=110.0)
    ring.draw(arms)


class _Ring:
    """A roundabout, whose entries and exits are arcs of radius `bend` that touch the arm's lane and the ring."""

    def __init__(self, town: Town, section: Section, radius: float, bend: float, speed: float) -> None:
        self._town, self._section, self._radius, self._bend = town, section, radius, bend
        side = section.width_m / 2.0 + bend
        self.box_m = math.sqrt((radius + bend) * (radius + bend) - side * side)
        self._phase = scalars.atan2(side, self.box_m)
        """Angle from an arm's heading to where its entry and its exit meet the ring."""
        self._turn = _QUARTER - self._phase
        self._style: dict[str, Any] = {
            "width_m": section.width_m,
            "lines": PLAIN,
            "speed_mps": speed,
            "junction": town.new_junction(),
        }

    def draw(self, arms: list[Arm]) -> None:
        """Draw ring, entries and exits; name the chains `<arm>.right0`, `<arm>.straight0`, `<arm>.left0`."""
        count = len(arms)
        enter = [self._enter(arm) for arm in arms]
        # counter-clockwise on the map: from the entry of arm k to the exit of arm k - 1, on to the entry of arm k - 1
        apart = [self._arc(arm.heading_rad - self._phase, _QUARTER - 2.0 * self._phase) for arm in arms]
        past = [self._arc(arm.heading_rad + self._phase, 2.0 * self._phase) for arm in arms]
        leave = [self._leave(arm) for arm in arms]
        for k, arm in enumerate(arms):
            inside: list[int] = [enter[k]]
            for step, turn in enumerate(("right", "straight", "left"), start=1):
                inside.append(apart[(k - step + 1) % count])
                target = (k - step) % count
                self._town.chains[f"{arm.name}.{turn}0"] = [
                    *self._town.chains[arm.inward("0")],
                    *inside,
                    leave[target],
                    *self._town.chains[arms[target].outward("0")],
                ]
                inside.append(past[target])

    def _arc(self, phase: float, angle: float) -> int:
        pose = (self._radius * scalars.cos(phase), self._radius * scalars.sin(phase), phase - _QUARTER)
        return self._town.add(piece(pose, self._radius * angle, -1.0 / self._radius, **self._style))

    def _enter(self, arm: Arm) -> int:
        x, y, heading = arm.edge()
        pose = moved((x, y, heading + math.pi), 0.0, self._section.width_m / 2.0)
        return self._town.add(piece(pose, self._bend * self._turn, 1.0 / self._bend, **self._style))

    def _leave(self, arm: Arm) -> int:
        end = moved(arm.edge(), 0.0, self._section.width_m / 2.0)
        bend = self._bend * self._turn, 1.0 / self._bend
        return self._town.add(piece(retreat(end, [bend]), *bend, **self._style))
