"""Turn actors into boxes."""

from __future__ import annotations

from pytest_drive_robust.arithmetic.compiled import cos, sin
from pytest_drive_robust.domain.truth import ActorState, WorldState
from pytest_drive_robust.jit.arrays import Floats, Floats2, Ints1, Ints2
from pytest_drive_robust.jit.kernels import entry, inner
from pytest_drive_robust.simulators.embedded.drawing import boxes as box
from pytest_drive_robust.simulators.embedded.drawing import looks as part
from pytest_drive_robust.simulators.embedded.drawing.looks import Role, paint_index

_ID, _KIND, _STATE = WorldState.ID, WorldState.KIND, WorldState.STATE
_X, _Y, _YAW, _SPEED = WorldState.X, WorldState.Y, WorldState.YAW, WorldState.SPEED
_LENGTH, _WIDTH, _HEIGHT = WorldState.LENGTH, WorldState.WIDTH, WorldState.HEIGHT
_BRAKING, _SIREN = int(ActorState.BRAKING), int(ActorState.SIREN)
_LEFT, _RIGHT = int(ActorState.INDICATOR_LEFT), int(ActorState.INDICATOR_RIGHT)
_BODY, _BRAKE_LAMP, _HEADLAMP = int(Role.BODY), int(Role.BRAKE_LAMP), int(Role.HEADLAMP)
_LEFT_INDICATOR, _RIGHT_INDICATOR = int(Role.LEFT_INDICATOR), int(Role.RIGHT_INDICATOR)
_LEFT_BEACON, _RIGHT_BEACON = int(Role.LEFT_BEACON), int(Role.RIGHT_BEACON)
_LEFT_LEG, _RIGHT_LEG = int(Role.LEFT_LEG), int(Role.RIGHT_LEG)

_paint_index = inner(paint_index)

_BLINK_TICKS = 8
_FLASH_TICKS = 3
_STRIDE_RAD_PER_TICK = 0.42


@entry
def assemble(
    rows: Floats2,
    ends: Ints1,
    first: int,
    actors: Floats2,
    tick: int,
    night: float,
    parts: Floats2,
    spans: Ints2,
    paints: Floats2,
) -> None:
    """Write the boxes of `actors` (k, 10) to `rows` from row `first` on.

    Actor k gets the rows from `ends[k]` up to `ends[k + 1]`: no rows when its kind has no parts. `parts` and `spans`
    come from `looks.part_rows`, `paints` is `looks.PAINTS`. `rows` must have room for the longest span times k, `ends`
    for k + 1. Blinking lamps and swinging legs depend only on `tick` and the actor's id.
    """
    at = first
    ends[0] = first
    for k in range(len(actors)):
        kind = int(actors[k, _KIND])
        if 0 <= kind < len(spans):
            c, s = cos(actors[k, _YAW]), sin(actors[k, _YAW])
            for p in range(spans[kind, 0], spans[kind, 1]):
                if _set_colour(rows, at, actors, k, tick, night, parts, p, paints):
                    _place(rows, at, actors, k, tick, parts, p, c, s)
                    at += 1
        ends[k + 1] = at


@inner
def _place(rows: Floats, at: int, actors: Floats, k: int, tick: int, parts: Floats, p: int, c: float, s: float) -> None:
    length, width, height = actors[k, _LENGTH], actors[k, _WIDTH], actors[k, _HEIGHT]
    forward, right = parts[p, part.X] * length, parts[p, part.Y] * width
    role = int(parts[p, part.ROLE])
    if role in (_LEFT_LEG, _RIGHT_LEG) and actors[k, _SPEED] > 0.05:
        swing = sin(tick * _STRIDE_RAD_PER_TICK + actors[k, _ID]) * 0.22 * min(length, 0.6)
        forward += swing if role == _LEFT_LEG else -swing
    rows[at, box.X] = actors[k, _X] + c * forward - s * right
    rows[at, box.Y] = actors[k, _Y] + s * forward + c * right
    rows[at, box.Z] = parts[p, part.Z] * height
    rows[at, box.COS], rows[at, box.SIN] = c, s
    rows[at, box.ALONG] = parts[p, part.LENGTH] * length
    rows[at, box.WIDE] = parts[p, part.WIDTH] * width
    rows[at, box.HIGH] = parts[p, part.HEIGHT] * height
    rows[at, box.FRONT] = parts[p, part.FRONT] * parts[p, part.LENGTH] * length
    rows[at, box.REAR] = parts[p, part.REAR] * parts[p, part.LENGTH] * length
    rows[at, box.SIDES] = parts[p, part.SIDES] * parts[p, part.WIDTH] * width
    rows[at, box.MATERIAL] = parts[p, part.MATERIAL]
    rows[at, box.SEED] = rows[at, box.INSTANCE] = actors[k, _ID]
    rows[at, box.REACH] = parts[p, part.REACH]


@inner
def _set_colour(
    rows: Floats, at: int, actors: Floats, k: int, tick: int, night: float, parts: Floats, p: int, paints: Floats
) -> bool:
    """Set the colour and glow of a part; return False when the part is not to be seen now."""
    state, role = int(actors[k, _STATE]), int(parts[p, part.ROLE])
    red, green, blue, glow = parts[p, part.RED], parts[p, part.GREEN], parts[p, part.BLUE], 0.0
    if role == _BODY:
        paint = _paint_index(int(actors[k, _ID]))
        red, green, blue = paints[paint, 0], paints[paint, 1], paints[paint, 2]
    elif role == _BRAKE_LAMP:
        red, green, blue, glow = (255.0, 44.0, 30.0, 1.0) if state & _BRAKING else (112.0, 10.0, 14.0, 0.9 * night)
    elif role == _HEADLAMP:
        red, green, blue, glow = 236.0 + 19.0 * night, 238.0 + 17.0 * night, 224.0 + 10.0 * night, night
    elif role in (_LEFT_INDICATOR, _RIGHT_INDICATOR):
        wanted = _LEFT if role == _LEFT_INDICATOR else _RIGHT
        if not state & wanted or (tick // _BLINK_TICKS) % 2:
            return False
        glow = 1.0
    elif role in (_LEFT_BEACON, _RIGHT_BEACON):
        turn = (tick // _FLASH_TICKS) % 2 == (0 if role == _LEFT_BEACON else 1)
        if state & _SIREN and turn:
            red, green, blue, glow = 120.0, 190.0, 255.0, 1.0
        else:
            red, green, blue = red * 0.6, green * 0.6, blue * 0.6
    rows[at, box.RED], rows[at, box.GREEN], rows[at, box.BLUE], rows[at, box.GLOW] = red, green, blue, glow
    return True
