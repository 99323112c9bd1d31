"""Two by two crossings with lights: blocks of houses on all sides."""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.simulators.embedded.towns.junction import Connection, connect, crosswalk
from pytest_drive_robust.simulators.embedded.towns.pieces import road
from pytest_drive_robust.simulators.embedded.towns.town import Arm, LaneKey, Section, Town

__all__ = ["grid"]

_ARM_M = 110.0
_QUARTER = math.pi / 2.0
_SIZE = 2


def grid(town: Town, rng: RandomNumbers) -> None:
    """Draw four crossings with lights, 75 to 95 m apart, one lane each way.

    Roads that lead out: `W0`, `W1` (row 0 lies in the north), `E0`, `E1`, `N0`, `N1` (column 0 lies in the west), `S0`,
    `S1`; between the crossings `H0`, `H1` lead east, `V0`, `V1` south. Chains: `W0.left0` turns left at its first
    crossing and then goes straight out of town, `W0.straight-left0` turns left at its second one.
    """
    width = rng.uniform(3.4, 3.7)
    section = Section(1, 1, width, rng.choice([10.0, 11.0, 12.5]))
    box = width + rng.uniform(5.0, 8.0)
    apart = rng.uniform(75.0, 95.0), rng.uniform(75.0, 95.0)
    ways: dict[LaneKey, list[Connection]] = {}
    for column in range(_SIZE):
        for row in range(_SIZE):
            centre = column * apart[0], row * apart[1]
            arms = _arms(column, row, centre, box, section)
            _draw(town, arms, (apart[0] - 2.0 * box, apart[1] - 2.0 * box))
    for column in range(_SIZE):
        for row in range(_SIZE):
            arms = _arms(column, row, (column * apart[0], row * apart[1]), box, section)
            for made in connect(town, arms, controls={arm.name: "light" for arm in arms}):
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


def _draw(town: Town, arms: list[Arm], between_m: tuple[float, float]) -> None:
    for arm in arms:
        if not arm.ends_here:
            length = {"H": between_m[0], "V": between_m[1]}.get(arm.name[0], _ARM_M)
            road(town, arm.name, arm.edge(), [(length, 0.0)], arm.section)
        crosswalk(town, arm)


def _name_chains(town: Town, ways: dict[LaneKey, list[Connection]]) -> None:
    for side in "EWNS":
        for number in range(_SIZE):
            entry = town.chains[f"{side}{number}.b0"]
            for first in ways[entry[-1]]:
                through = [*entry, first.key, *town.chains[first.target.outward("0")]]
                town.chains[f"{side}{number}.{first.turn}0"] = _straight_out(town, ways, through)
                for second in ways.get(through[-1], ()):
                    chain = [*through, second.key, *town.chains[second.target.outward("0")]]
                    town.chains[f"{side}{number}.{first.turn}-{second.turn}0"] = _straight_out(town, ways, chain)


def _straight_out(town: Town, ways: dict[LaneKey, list[Connection]], chain: list[LaneKey]) -> list[LaneKey]:
    """Prolong a chain straight on over every crossing to the edge of the town."""
    while chain[-1] in ways:
        onward = next(made for made in ways[chain[-1]] if made.turn == "straight")
        chain = [*chain, onward.key, *town.chains[onward.target.outward("0")]]
    return chain
