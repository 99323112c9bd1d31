"""Boxes of the static objects of a map: buildings, traffic lights, stop signs, street lamps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pytest_drive_robust.arithmetic.scalars import cos, sin
from pytest_drive_robust.domain.truth import LaneMap, LightState, StopLine
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.simulators.embedded.drawing.boxes import BLUE, GLOW, RED, Box, Material, box_rows
from pytest_drive_robust.simulators.embedded.drawing.street_lamps import lamp_boxes, lamp_places

_WALLS = (
    (168.0, 120.0, 98.0),
    (186.0, 176.0, 156.0),
    (140.0, 146.0, 152.0),
    (196.0, 164.0, 120.0),
    (152.0, 108.0, 92.0),
)
_POLE = (92.0, 94.0, 98.0)
_HOUSING = (26.0, 27.0, 30.0)
_STOP_RED = (190.0, 20.0, 28.0)
_WHITE = (240.0, 240.0, 240.0)
_DIM = 0.22

# Housing and lamps are drawn about 1.8 times as large as real ones: a lamp of 0.3 m is 1.4 pixels in 256 x 144 at 40 m.
_LAMP_M = 0.5
_HOUSING_M = (0.36, 0.74, 1.86)
_HOUSING_BOTTOM_M = 3.1
_SIGN_M = 1.0
_SIGN_BOTTOM_M = 1.7

LAMP_COLOURS = {
    LightState.RED: (255.0, 36.0, 28.0),
    LightState.YELLOW: (255.0, 190.0, 20.0),
    LightState.GREEN: (40.0, 255.0, 90.0),
}
"""RGB of a lit lamp; the housing holds them in this order from top to bottom."""


@dataclass(frozen=True, slots=True)
class Furniture:
    """Box rows of all static objects, and which rows are lamps of traffic lights.

    `rows` is (n, BOX_COLUMNS). Row `lamp_rows[i]` is lit while the light of stop line `lamp_lines[i]` has the
    `LightState` `lamp_states[i]` (all (m,)). `lit` and `dim` (m, 3) are the colours of a lit and of a dark lamp.
    `street_lamps` (k, 3) are the `lamp_places`.
    """

    rows: Floats
    lamp_rows: Ints
    lamp_lines: Ints
    lamp_states: Ints
    lit: Floats
    dim: Floats
    street_lamps: Floats

    @classmethod
    def of(cls, lane_map: LaneMap, *, night: float = 0.0) -> Furniture:
        """Build the boxes of `lane_map`; `night` 0..1 is the brightness of street lamps."""
        boxes = [_building(index, building) for index, building in enumerate(lane_map.buildings)]
        lamps: list[tuple[int, int, LightState]] = []
        for index, line in enumerate(lane_map.stop_lines):
            if not line.is_light:
                boxes += _stop_sign(line)
                continue
            boxes += _light(line)
            for place, state in enumerate(LAMP_COLOURS):
                octagon = _octagon(line, _HOUSING_BOTTOM_M + 0.08 + 0.6 * (2 - place), _LAMP_M, _HOUSING_M[0] / 2.0)
                lamps += [(len(boxes) + part, index, state) for part in range(len(octagon))]
                boxes += octagon
        lit = np.array([LAMP_COLOURS[state] for _, _, state in lamps]).reshape(len(lamps), 3)
        rows, lines, states = (np.array([lamp[column] for lamp in lamps], np.int64) for column in range(3))
        places = lamp_places(lane_map)
        boxes += lamp_boxes(places, night=night)
        return cls(box_rows(boxes), rows, lines, states, lit, lit * _DIM, places)

    def show(self, rows: Floats, lights: Ints) -> None:
        """Set the colours of the lamps in `rows`, a copy of `self.rows`, to the states `lights` of the stop lines."""
        if len(self.lamp_rows):
            shines = lights[self.lamp_lines] == self.lamp_states
            rows[self.lamp_rows, RED : BLUE + 1] = np.where(shines[:, None], self.lit, self.dim)
            rows[self.lamp_rows, GLOW] = shines


def _building(index: int, row: Floats) -> Box:
    x, y, yaw, length, width, height = (float(value) for value in row)
    colour = _WALLS[index % len(_WALLS)]
    return Box(x, y, 0.0, yaw, length, width, height, colour, material=Material.FACADE, seed=index)


def _light(line: StopLine) -> list[Box]:
    x, y, heading = line.pole_x_m, line.pole_y_m, line.heading_rad
    depth, width, height = _HOUSING_M
    pole = Box(x, y, 0.0, heading, 0.18, 0.18, _HOUSING_BOTTOM_M, _POLE)
    return [pole, Box(x, y, _HOUSING_BOTTOM_M, heading, depth, width, height, _HOUSING)]


def _stop_sign(line: StopLine) -> list[Box]:
    x, y, heading = line.pole_x_m, line.pole_y_m, line.heading_rad
    pole = Box(x, y, 0.0, heading, 0.1, 0.1, _SIGN_BOTTOM_M + 0.1, _POLE)
    back = [replace(box, colour=_POLE) for box in _octagon(line, _SIGN_BOTTOM_M, _SIGN_M, 0.0)]
    rim = [replace(box, colour=_WHITE) for box in _octagon(line, _SIGN_BOTTOM_M, _SIGN_M, 0.04)]
    face = _octagon(line, _SIGN_BOTTOM_M + 0.05, _SIGN_M - 0.1, 0.07)
    word = [_letter(line, place) for place in (-1.5, -0.5, 0.5, 1.5)]
    return [pole, *back, *rim, *(replace(box, colour=_STOP_RED) for box in face), *word]


def _letter(line: StopLine, place: float) -> Box:
    """Return a white block for a letter of the word on a stop sign."""
    c, s = cos(line.heading_rad), sin(line.heading_rad)
    x, y = line.pole_x_m - 0.1 * c - 0.18 * place * s, line.pole_y_m - 0.1 * s + 0.18 * place * c
    bottom = _SIGN_BOTTOM_M + _SIGN_M / 2.0 - 0.14
    return Box(x, y, bottom, line.heading_rad, 0.03, 0.1, 0.28, _WHITE, reach_m=40.0)


def _octagon(line: StopLine, bottom_m: float, size_m: float, before_m: float) -> list[Box]:
    """Return three boxes that form an upright octagonal plate, `before_m` in front of the pole."""
    heading = line.heading_rad
    x, y = line.pole_x_m - before_m * cos(heading), line.pole_y_m - before_m * sin(heading)
    corner = size_m * 0.293
    side = size_m - 2.0 * corner
    plain = (0.0, 0.0, 0.0)
    return [
        Box(x, y, bottom_m, heading, 0.05, side, corner, plain, sides_m=-corner),
        Box(x, y, bottom_m + corner, heading, 0.05, size_m, side, plain),
        Box(x, y, bottom_m + corner + side, heading, 0.05, size_m, corner, plain, sides_m=corner),
    ]
