"""Find the bodies that touch the ego, apply the effect of a contact to both, and record events."""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic.compiled import cos_sin, hypot
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.jit.kernels import entry, inner
from pytest_drive_robust.simulators.criteria import STANDING_MPS
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

STUN_TICKS = 40
"""Ticks for which an actor stands after a contact."""
SAME_ACTOR_S, SAME_PLACE_M = 5.0, 5.0
"""A contact within this time with the same actor, or this near to the last collision, is none (`CollisionTest`)."""
_LYING_M, _KEPT_SPEED = 0.3, 0.8
"""Height of what the ego has knocked over, and the share of its speed that the ego keeps."""
_PEDESTRIAN = int(ActorKind.PEDESTRIAN)
_CONE = int(ActorKind.CONE)
_SIGN = int(ActorKind.WARNING_SIGN)


@entry
def overlap(
    x: float, y: float, yaw: float, length: float, width: float, ox: float, oy: float, oyaw: float, olength: float,
    owidth: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Return (depth, nx, ny) by separating axes; depth <= 0 means no contact, n pushes the first box out."""
    dx, dy = x - ox, y - oy
    best, bx, by = 1e18, 0.0, 0.0
    for axis in range(4):
        angle = (yaw if axis < 2 else oyaw) + (axis % 2) * math.pi / 2.0
        ax, ay = cos_sin(angle)
        along, beside = cos_sin(angle - yaw)
        mine = 0.5 * (abs(along) * length + abs(beside) * width)
        along, beside = cos_sin(angle - oyaw)
        theirs = 0.5 * (abs(along) * olength + abs(beside) * owidth)
        distance = dx * ax + dy * ay
        depth = mine + theirs - abs(distance)
        if depth <= 0.0:
            return 0.0, 0.0, 0.0
        if depth < best:
            sign = 1.0 if distance >= 0.0 else -1.0
            best, bx, by = depth, sign * ax, sign * ay
    return best, bx, by


@inner
def _was_hit_here(world: WorldArrays) -> bool:
    """Return whether the ego is near its last collision, where a contact counts as that collision."""
    ego, criteria = world.ego, world.criteria
    return hypot(ego[c.EGO_X] - criteria[c.C_LAST_HIT_X], ego[c.EGO_Y] - criteria[c.C_LAST_HIT_Y]) < SAME_PLACE_M


@inner
def _touch(world: WorldArrays, nx: float, ny: float, depth: float, i: int) -> None:
    """Record a contact of depth [m] with actor i (-1: a building) if it is a new one and the ego drives; push it out.

    (nx, ny) is the direction that leads the ego out.
    """
    ego, criteria = world.ego, world.criteria
    v = ego[c.EGO_V]
    again = i >= 0 and (world.clock[c.TICK] - world.actor_ints[i, c.I_LAST_HIT]) * world.dt_s < SAME_ACTOR_S
    if not _was_hit_here(world) and not again and v >= STANDING_MPS:
        note(world, c.EVENT_COLLISION, float(i), v)
        criteria[c.C_LAST_HIT_X], criteria[c.C_LAST_HIT_Y] = ego[c.EGO_X], ego[c.EGO_Y]
        if i >= 0:
            world.actor_ints[i, c.I_LAST_HIT] = world.clock[c.TICK]
    if i >= 0:
        kind = world.actor_ints[i, c.I_KIND]
        # an actor that does not see all scrapes past a standing ego, because stopping would block both for ever
        if v >= STANDING_MPS or world.actor_ints[i, c.I_SEES] == c.SEES_ALL:
            world.actor_ints[i, c.I_STUN] = STUN_TICKS
            _wake_flow(world, world.actor_ints[i, c.I_FLOW])
        if kind in (_PEDESTRIAN, _CONE, _SIGN):
            world.actor_ints[i, c.I_SOLID] = 0
            world.actor_ints[i, c.I_MODE] = c.MODE_STATIC
            world.actors[i, c.A_HEIGHT] = _LYING_M
            world.actors[i, c.A_V] = 0.0
            ego[c.EGO_V] *= _KEPT_SPEED
            return
    ego[c.EGO_X] += nx * depth
    ego[c.EGO_Y] += ny * depth
    along, beside = cos_sin(ego[c.EGO_YAW])
    against = nx * along + ny * beside
    if against < 0.0:
        ego[c.EGO_V] = max(0.0, v * (1.0 + against))


@inner
def _wake_flow(world: WorldArrays, flow: int) -> None:
    """Make all drivers of a flow brake for bodies ahead, because one driver of the flow was hit."""
    if flow < 0:
        return
    for k in range(world.flow_ints[flow, c.FI_FIRST_SLOT], world.flow_ints[flow, c.FI_LAST_SLOT]):
        world.actor_ints[k, c.I_SEES] = c.SEES_ALL


@inner
def _actor_depth(world: WorldArrays, i: int, x: float, y: float) -> tuple[float, float, float]:
    """Return `overlap` of the ego at (x, y) with the solid body `i`; depth 0 for an absent body."""
    if world.actor_ints[i, c.I_ACTIVE] != c.PRESENT or world.actor_ints[i, c.I_SOLID] == 0:
        return 0.0, 0.0, 0.0
    other = world.actors[i]
    length, width = world.ego_length_m, world.ego_width_m
    reach = 0.5 * (length + width + other[c.A_LENGTH] + other[c.A_WIDTH])
    if abs(other[c.A_X] - x) > reach or abs(other[c.A_Y] - y) > reach:
        return 0.0, 0.0, 0.0
    return overlap(
        x, y, world.ego[c.EGO_YAW], length, width,
        other[c.A_X], other[c.A_Y], other[c.A_YAW], other[c.A_LENGTH], other[c.A_WIDTH],
    )  # fmt: skip


@inner
def _building_depth(world: WorldArrays, k: int, x: float, y: float) -> tuple[float, float, float]:
    """Return `overlap` of the ego at (x, y) with building `k`."""
    box, length = world.buildings[k], world.ego_length_m
    reach = 0.5 * (length + box[3] + box[4])
    if abs(box[0] - x) > reach or abs(box[1] - y) > reach:
        return 0.0, 0.0, 0.0
    return overlap(x, y, world.ego[c.EGO_YAW], length, world.ego_width_m, box[0], box[1], box[2], box[3], box[4])


@inner
def hold_back(world: WorldArrays, before_mps: float) -> None:
    """Hold an ego that presses against a body after a collision. `before_mps`: its speed at the start of the tick.

    Without this hold, the ego would gain speed in one tick, lose that speed in the next tick, and never count as
    standing. Bodies that the ego knocks over do not hold the ego. Away from the last collision nothing holds the ego,
    so that a new contact counts as a collision.
    """
    ego = world.ego
    if before_mps >= STANDING_MPS or ego[c.EGO_V] == 0.0 or not _was_hit_here(world):
        return
    along, beside = cos_sin(ego[c.EGO_YAW])
    ahead_m = ego[c.EGO_V] * world.dt_s
    x, y, freedom = ego[c.EGO_X] + ahead_m * along, ego[c.EGO_Y] + ahead_m * beside, 1.0
    for i in range(len(world.actors)):
        if world.actor_ints[i, c.I_KIND] not in (_PEDESTRIAN, _CONE, _SIGN):
            depth, nx, ny = _actor_depth(world, i, x, y)
            if depth > 0.0:
                freedom = min(freedom, 1.0 + nx * along + ny * beside)
    for k in range(len(world.buildings)):
        depth, nx, ny = _building_depth(world, k, x, y)
        if depth > 0.0:
            freedom = min(freedom, 1.0 + nx * along + ny * beside)
    ego[c.EGO_V] *= max(freedom, 0.0)


@inner
def contacts(world: WorldArrays) -> None:
    """Find every solid body and building that the ego overlaps at the end of the tick."""
    ego = world.ego
    for i in range(len(world.actors)):
        depth, nx, ny = _actor_depth(world, i, ego[c.EGO_X], ego[c.EGO_Y])
        if depth > 0.0:
            _touch(world, nx, ny, depth, i)
    for k in range(len(world.buildings)):
        depth, nx, ny = _building_depth(world, k, ego[c.EGO_X], ego[c.EGO_Y])
        if depth > 0.0:
            _touch(world, nx, ny, depth, -1)


@inner
def note(world: WorldArrays, kind: int, actor: float, value: float) -> None:
    """Append one event with the tick and the place of the ego; drop the event once `EVENT_CAPACITY` are stored."""
    count = world.criteria_ints[c.CI_EVENTS]
    if count < len(world.events):
        row = world.events[count]
        row[c.EV_KIND], row[c.EV_TICK], row[c.EV_ACTOR], row[c.EV_VALUE] = kind, world.clock[c.TICK], actor, value
        row[c.EV_X], row[c.EV_Y] = world.ego[c.EGO_X], world.ego[c.EGO_Y]
        world.criteria_ints[c.CI_EVENTS] = count + 1
