"""Appearance of each kind of actor: boxes in shares of the actor's own length, width and height."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from enum import IntEnum
from functools import cache

import numpy as np

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.simulators.embedded.drawing.boxes import Material

Colour = tuple[float, float, float]


class Role(IntEnum):
    """The rule for the colour and the visibility of a part."""

    FIXED = 0
    """`Part.colour`."""
    BODY = 1
    """The actor's own colour from `PAINTS`, by its id."""
    BRAKE_LAMP = 2
    HEADLAMP = 3
    LEFT_INDICATOR = 4
    """Seen only while it is lit."""
    RIGHT_INDICATOR = 5
    LEFT_BEACON = 6
    """Flashes in turn with the right one while the siren is on."""
    RIGHT_BEACON = 7
    LEFT_LEG = 8
    """Swings while the actor moves."""
    RIGHT_LEG = 9


@dataclass(frozen=True, slots=True)
class Part:
    """One box of an actor.

    `x`, `y` (centre, forward and right), `z` (bottom), `length`, `width` and `height` are shares of the actor's length,
    width and height. `front`, `rear` and `sides` draw the top in by a share of the part's own length and width. A part
    farther away than `reach_m` is not drawn.
    """

    x: float
    y: float
    z: float
    length: float
    width: float
    height: float
    colour: Colour = (0.0, 0.0, 0.0)
    role: Role = Role.FIXED
    front: float = 0.0
    rear: float = 0.0
    sides: float = 0.0
    material: Material = Material.PLAIN
    reach_m: float = 1e9


_GLASS = (34.0, 42.0, 52.0)
_TYRE = (22.0, 22.0, 24.0)
_SPOKES = (132.0, 132.0, 132.0)
_STEEL = (120.0, 122.0, 126.0)
_WHITE = (236.0, 236.0, 232.0)
_RED = (196.0, 30.0, 34.0)
_SKIN = (222.0, 172.0, 138.0)
_HAIR = (58.0, 42.0, 32.0)
_TROUSERS = (44.0, 48.0, 70.0)
_ORANGE = (238.0, 104.0, 24.0)
_AMBER = (255.0, 170.0, 20.0)
_BLUE = (40.0, 90.0, 255.0)

PAINTS = np.array(
    (
        (178, 34, 38), (30, 78, 160), (226, 226, 222), (52, 54, 60), (158, 164, 170), (36, 112, 72),
        (224, 176, 44), (98, 52, 116), (200, 104, 44), (28, 132, 150), (140, 96, 64), (236, 160, 168),
    ),
    np.float64,
)  # fmt: skip
"""(n, 3) RGB: the colours that actors are painted with; neighbouring ids look different."""


def paint_of(number: int) -> tuple[int, int, int]:
    """Return the colour, RGB 0..255, of the actor whose id is `number`."""
    red, green, blue = (int(channel) for channel in PAINTS[paint_index(number)])
    return red, green, blue


def paint_index(number: int) -> int:
    """Return the row of `PAINTS` of the actor whose id is `number`."""
    return (number * 5 + 1) % len(PAINTS)


def _wheels(x: float, length: float, height: float) -> list[Part]:
    """Return four wheels, each of two boxes: narrow at the ground, full at the hub."""
    return [
        Part(along, side, bottom, length * share, 0.12, height / 2.0, _TYRE, front=taper, rear=taper, reach_m=reach)
        for along in (-x, x)
        for side in (-0.44, 0.44)
        for bottom, share, taper, reach in ((0.0, 0.6, -0.3, 90.0), (height / 2.0, 0.96, 0.12, 40.0))
    ]


def _lamps(z: float, height: float, width: float = 0.17) -> list[Part]:
    """Return the rear lamps, front lamps, indicators at the four corners."""
    sides = ((-0.39, Role.LEFT_INDICATOR), (0.39, Role.RIGHT_INDICATOR))
    rear = [Part(-0.5, y, z, 0.02, width, height, role=Role.BRAKE_LAMP) for y, _ in sides]
    front = [Part(0.492, y, z, 0.03, width, height, role=Role.HEADLAMP) for y, _ in sides]
    blinkers = [
        Part(x, y * 1.18, z - 0.01, 0.03, width * 0.6, height + 0.02, _AMBER, role)
        for x in (-0.497, 0.492)
        for y, role in sides
    ]
    return rear + front + blinkers


LOOKS: dict[ActorKind, list[Part]] = {
    ActorKind.CAR: [
        Part(0.0, 0.0, 0.15, 1.0, 0.97, 0.24, role=Role.BODY),
        Part(0.0, 0.0, 0.39, 1.0, 0.97, 0.18, role=Role.BODY, front=0.05, rear=0.02, sides=0.02),
        Part(-0.06, 0.0, 0.56, 0.66, 0.92, 0.37, _GLASS, front=0.3, rear=0.16, sides=0.1),
        Part(-0.106, 0.0, 0.92, 0.37, 0.75, 0.08, role=Role.BODY, front=0.06, rear=0.06, sides=0.04),
        Part(-0.5, 0.0, 0.27, 0.014, 0.28, 0.08, _WHITE, reach_m=30.0),
        *_wheels(0.31, 0.145, 0.42),
        *_lamps(0.4, 0.13),
    ],
    ActorKind.VAN: [
        Part(0.0, 0.0, 0.12, 1.0, 0.97, 0.42, role=Role.BODY),
        Part(-0.02, 0.0, 0.53, 0.96, 0.96, 0.47, role=Role.BODY, front=0.17, sides=0.05),
        Part(0.295, 0.0, 0.56, 0.35, 0.955, 0.3, _GLASS, front=0.32, rear=0.05, sides=0.025),
        Part(-0.494, 0.0, 0.6, 0.02, 0.7, 0.24, _GLASS, sides=0.05),
        Part(-0.5, 0.0, 0.3, 0.014, 0.26, 0.05, _WHITE, reach_m=30.0),
        *_wheels(0.31, 0.13, 0.33),
        *_lamps(0.36, 0.16, 0.12),
    ],
    ActorKind.TRUCK: [
        Part(0.0, 0.0, 0.12, 0.98, 0.8, 0.12, (52.0, 52.0, 56.0)),
        Part(0.385, 0.0, 0.14, 0.23, 0.96, 0.62, role=Role.BODY, front=0.12),
        Part(0.47, 0.0, 0.46, 0.07, 0.88, 0.23, _GLASS, front=0.3),
        Part(0.385, 0.0, 0.46, 0.12, 0.975, 0.2, _GLASS, reach_m=60.0),
        Part(-0.12, 0.0, 0.24, 0.76, 1.0, 0.76, (214.0, 214.0, 206.0)),
        Part(-0.12, 0.0, 0.46, 0.762, 1.006, 0.14, role=Role.BODY),
        *_wheels(0.33, 0.14, 0.3),
        *_lamps(0.16, 0.06, 0.16),
    ],
    ActorKind.EMERGENCY: [
        Part(0.0, 0.0, 0.12, 1.0, 0.97, 0.42, _WHITE),
        Part(-0.02, 0.0, 0.53, 0.96, 0.96, 0.34, _WHITE, front=0.17, sides=0.05),
        Part(0.0, 0.0, 0.36, 1.006, 0.985, 0.12, _RED),
        Part(0.295, 0.0, 0.56, 0.35, 0.955, 0.26, _GLASS, front=0.32, rear=0.05, sides=0.025),
        Part(-0.494, 0.0, 0.6, 0.02, 0.7, 0.2, _GLASS, sides=0.05),
        Part(0.06, -0.23, 0.86, 0.1, 0.36, 0.14, _BLUE, Role.LEFT_BEACON),
        Part(0.06, 0.23, 0.86, 0.1, 0.36, 0.14, _BLUE, Role.RIGHT_BEACON),
        *_wheels(0.31, 0.13, 0.33),
        *_lamps(0.2, 0.14, 0.14),
    ],
    ActorKind.BICYCLE: [
        *(
            Part(x, 0.0, z, 0.36 * share, 0.1, 0.13, _TYRE, front=taper, rear=taper)
            for x in (-0.31, 0.31)
            for z, share, taper in ((0.0, 0.5, -0.5), (0.13, 1.0, 0.0), (0.26, 1.0, 0.25))
        ),
        Part(-0.31, 0.0, 0.09, 0.22, 0.12, 0.2, _SPOKES),
        Part(0.31, 0.0, 0.09, 0.22, 0.12, 0.2, _SPOKES),
        Part(0.0, 0.0, 0.32, 0.56, 0.13, 0.05, _RED),
        Part(0.24, 0.0, 0.36, 0.05, 0.1, 0.22, _STEEL),
        Part(0.24, 0.0, 0.56, 0.06, 0.85, 0.04, _TYRE),
        Part(-0.03, -0.22, 0.14, 0.13, 0.22, 0.38, _TROUSERS, Role.LEFT_LEG),
        Part(-0.03, 0.22, 0.14, 0.13, 0.22, 0.38, _TROUSERS, Role.RIGHT_LEG),
        Part(-0.05, 0.0, 0.5, 0.22, 0.66, 0.33, role=Role.BODY, front=-0.1, rear=0.2, sides=-0.04),
        Part(0.11, 0.0, 0.62, 0.24, 0.78, 0.07, role=Role.BODY),
        Part(0.02, 0.0, 0.83, 0.12, 0.3, 0.1, _SKIN),
        Part(0.01, 0.0, 0.91, 0.16, 0.36, 0.09, _WHITE, front=0.2, rear=0.2, sides=0.2),
    ],
    ActorKind.PEDESTRIAN: [
        Part(0.0, -0.2, 0.0, 0.4, 0.3, 0.48, _TROUSERS, Role.LEFT_LEG),
        Part(0.0, 0.2, 0.0, 0.4, 0.3, 0.48, _TROUSERS, Role.RIGHT_LEG),
        Part(0.0, 0.0, 0.46, 0.56, 0.72, 0.38, role=Role.BODY, sides=-0.04),
        Part(0.0, -0.44, 0.46, 0.3, 0.14, 0.36, role=Role.BODY),
        Part(0.0, 0.44, 0.46, 0.3, 0.14, 0.36, role=Role.BODY),
        Part(0.04, 0.0, 0.85, 0.4, 0.36, 0.1, _SKIN),
        Part(0.0, 0.0, 0.94, 0.46, 0.42, 0.06, _HAIR, front=0.15, rear=0.15, sides=0.15),
        Part(-0.1, 0.0, 0.85, 0.28, 0.4, 0.1, _HAIR),
    ],
    ActorKind.CONE: [
        Part(0.0, 0.0, 0.0, 1.0, 1.0, 0.07, (60.0, 40.0, 34.0)),
        Part(0.0, 0.0, 0.07, 0.74, 0.74, 0.36, _ORANGE, front=0.16, rear=0.16, sides=0.16),
        Part(0.0, 0.0, 0.43, 0.5, 0.5, 0.24, _WHITE, front=0.16, rear=0.16, sides=0.16),
        Part(0.0, 0.0, 0.67, 0.34, 0.34, 0.33, _ORANGE, front=0.25, rear=0.25, sides=0.25),
    ],
    ActorKind.BARRIER: [
        Part(0.0, 0.0, 0.42, 1.0, 0.5, 0.5, _RED, material=Material.STRIPES),
        Part(-0.38, 0.0, 0.0, 0.06, 1.0, 0.44, _STEEL),
        Part(0.38, 0.0, 0.0, 0.06, 1.0, 0.44, _STEEL),
    ],
    ActorKind.CONTAINER: [Part(0.0, 0.0, 0.03, 1.0, 1.0, 0.97, role=Role.BODY, material=Material.RIBS)],
    ActorKind.WARNING_SIGN: [
        Part(0.0, -0.34, 0.0, 0.4, 0.06, 0.4, _STEEL),
        Part(0.0, 0.34, 0.0, 0.4, 0.06, 0.4, _STEEL),
        Part(0.0, 0.0, 0.34, 0.5, 1.0, 0.66, _RED, sides=0.47),
        Part(0.0, 0.0, 0.4, 0.7, 0.7, 0.45, _WHITE, sides=0.46),
        Part(0.0, 0.0, 0.51, 0.9, 0.08, 0.2, _TYRE),
        Part(0.0, 0.0, 0.44, 0.9, 0.08, 0.05, _TYRE),
    ],
    ActorKind.DOOR: [
        Part(0.0, 0.0, 0.18, 0.1, 1.0, 0.5, role=Role.BODY),
        Part(0.0, 0.06, 0.68, 0.08, 0.88, 0.3, _GLASS, sides=0.08),
        Part(0.0, -0.47, 0.18, 0.12, 0.06, 0.5, _ORANGE),
    ],
    ActorKind.DIRT: [
        Part(0.0, 0.0, 0.0, 1.0, 0.4, 1.0, (120.0, 88.0, 56.0)),
        Part(-0.03, 0.05, 0.0, 0.84, 0.72, 1.2, (112.0, 80.0, 50.0)),
        Part(0.04, -0.03, 0.0, 0.52, 1.0, 1.4, (104.0, 74.0, 46.0)),
        Part(0.08, 0.1, 0.0, 0.36, 0.3, 1.6, (84.0, 60.0, 38.0)),
    ],
    ActorKind.BUILDING: [Part(0.0, 0.0, 0.0, 1.0, 1.0, 1.0, role=Role.BODY, material=Material.FACADE)],
}
"""The parts of every kind."""


X, Y, Z, LENGTH, WIDTH, HEIGHT, RED, GREEN, BLUE, ROLE, FRONT, REAR, SIDES, MATERIAL, REACH = range(15)
"""The columns of `part_rows`: the fields of `Part` in their order, a colour as three."""


@cache
def part_rows() -> tuple[Floats, Ints]:
    """Return all parts as (n, 15), and for each kind its first row and the row after its last, (k, 2)."""
    rows: list[tuple[float, ...]] = []
    spans = np.zeros((len(ActorKind), 2), np.int64)
    for kind, parts in LOOKS.items():
        spans[kind] = len(rows), len(rows) + len(parts)
        for part in parts:
            x, y, z, length, width, height, colour, *rest = astuple(part)
            rows.append((x, y, z, length, width, height, *colour, *(float(value) for value in rest)))
    return np.array(rows, np.float64), spans
