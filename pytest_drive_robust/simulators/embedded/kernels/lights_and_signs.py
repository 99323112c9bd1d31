"""Judge traffic lights and stop signs."""

from __future__ import annotations

from pytest_drive_robust.arithmetic.compiled import cos, cos_sin, hypot
from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.criteria import STANDING_MPS
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.contacts import note
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

LIGHT_RADIUS_M, STOP_RADIUS_M = 15.0, 4.0
"""Distances within which a light and a stop sign are looked at (`RunningRedLightTest`, `RunningStopTest`)."""
_RED = int(LightState.RED)


@inner
def judge_red_lights(world: WorldArrays) -> None:
    """Record an infraction when the rear of the ego crosses the stop line of a red light in the direction of the lane.

    Stop lines are wider than their lanes, so a rear between two lanes crosses both lines. A light counts once, because
    Bench2Drive counts by the id of the light.
    """
    ego = world.ego
    half = world.ego_length_m / 2.0
    ch, sh = cos_sin(ego[c.EGO_YAW])
    ax, ay = ego[c.EGO_X] - 0.8 * half * ch, ego[c.EGO_Y] - 0.8 * half * sh
    bx, by = ego[c.EGO_X] - (half + 1.0) * ch, ego[c.EGO_Y] - (half + 1.0) * sh
    for k in range(len(world.stop_lines)):
        light = world.stop_light[k]
        if world.stop_is_light[k] == 0 or world.lights[k] != _RED or world.criteria_ints[c.CI_LAST_LIGHT] == light:
            continue
        x, y, heading, width = world.stop_lines[k]
        if hypot(x - ego[c.EGO_X], y - ego[c.EGO_Y]) > LIGHT_RADIUS_M or cos(heading - ego[c.EGO_YAW]) < 0.2:
            continue
        ahead_x, ahead_y = cos_sin(heading)
        rx, ry = -ahead_y * 0.6 * width, ahead_x * 0.6 * width
        if _crosses(ax, ay, bx, by, x - rx, y - ry, x + rx, y + ry):
            world.criteria_ints[c.CI_LAST_LIGHT] = light
            note(world, c.EVENT_RED_LIGHT, float(k), 0.0)


@inner
def _crosses(ax: float, ay: float, bx: float, by: float, px: float, py: float, qx: float, qy: float) -> bool:
    """Return whether the segments a-b and p-q cross."""
    d1 = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    d2 = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    d3 = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    d4 = (qx - px) * (by - py) - (qy - py) * (bx - px)
    return d1 * d2 < 0.0 and d3 * d4 < 0.0


@inner
def judge_stop_signs(world: WorldArrays) -> None:
    """Record an infraction when the ego leaves a stop sign without having stopped."""
    ego, ints = world.ego, world.criteria_ints
    current = ints[c.CI_STOP_LINE]
    front = world.ego_length_m / 2.0
    ch, sh = cos_sin(ego[c.EGO_YAW])
    fx, fy = ego[c.EGO_X] + front * ch, ego[c.EGO_Y] + front * sh
    if current < 0:
        for k in range(len(world.stop_lines)):
            x, y, heading, _ = world.stop_lines[k]
            near = hypot(x - fx, y - fy) < STOP_RADIUS_M
            if world.stop_is_light[k] == 0 and near and cos(heading - ego[c.EGO_YAW]) > 0.5:
                ints[c.CI_STOP_LINE], ints[c.CI_STOPPED] = k, 0
                current = k
                break
    if current < 0:
        return
    if ego[c.EGO_V] < STANDING_MPS:
        ints[c.CI_STOPPED] = 1
    x, y, heading, _ = world.stop_lines[current]
    ch, sh = cos_sin(heading)
    beyond = (ego[c.EGO_X] - x) * ch + (ego[c.EGO_Y] - y) * sh
    away = hypot(x - ego[c.EGO_X], y - ego[c.EGO_Y])
    if beyond > front and away > STOP_RADIUS_M:
        if ints[c.CI_STOPPED] == 0:
            note(world, c.EVENT_STOP_SIGN, float(current), ego[c.EGO_V])
        ints[c.CI_STOP_LINE] = -1
