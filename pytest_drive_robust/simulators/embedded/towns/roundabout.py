"""A roundabout with one lane and four arms; traffic goes counter-clockwise on the map."""

from __future__ import annotations

import math
from typing import Any

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers
from pytest_drive_robust.simulators.embedded.geometry import moved
from pytest_drive_robust.simulators.embedded.towns.junction import draw_arms
from pytest_drive_robust.simulators.embedded.towns.pieces import PLAIN, piece, retreat
from pytest_drive_robust.simulators.embedded.towns.town import Arm, Section, Town

_ARMS = "ESWN"
_QUARTER = math.pi / 2.0


def roundabout(town: Town, rng: RandomNumbers) -> None:
    """Draw a ring of 14 to 20 m radius with four arms; who is in the ring goes first."""
    width, radius = rng.uniform(3.5, 3.8), rng.uniform(14.0, 20.0)
    bend = rng.uniform(11.0, 14.0)
    section = Section(1, 1, width, rng.choice([11.0, 12.5]))
    ring = _Ring(town, section, radius, bend, rng.uniform(7.0, 8.0))
    arms = [Arm(name, k * _QUARTER, ring.box_m, section) for k, name in enumerate(_ARMS)]
    draw_arms(town, arms, length_m=110.0)
    ring.draw(arms)


class _Ring:
    """The entries and exits are arcs of radius `bend` that touch the arm's lane and the ring."""

    def __init__(self, town: Town, section: Section, radius: float, bend: float, speed: float) -> None:
        self._town, self._section, self._radius, self._bend = town, section, radius, bend
        side = section.width_m / 2.0 + bend
        self.box_m = math.sqrt((radius + bend) * (radius + bend) - side * side)
        self._phase = scalars.atan2(side, self.box_m)
        """How far from an arm's heading its entry and its exit meet the ring."""
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
