"""Project all bodies on the paths of actors, once per tick for all drivers."""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic.compiled import cos_sin
from pytest_drive_robust.jit.arrays import Floats, Ints
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

ON_PATH_M = 6.0
"""Greatest distance of a body from a path that it is on."""


@inner
def _project(paths: Floats, first: int, last: int, step_m: float, x: float, y: float) -> tuple[float, float, float]:
    """Return (metres along the path, metres to its right, path yaw there) of a place; (-1, ...) when off the path."""
    k = at = first
    best = 1e18
    while k < last:
        dx, dy = x - paths[k, 0], y - paths[k, 1]
        d = dx * dx + dy * dy
        if d < best:
            best, at = d, k
        # the skipped points of the path are too far away to be within ON_PATH_M of the place
        k += 2 if d < 100.0 else max(2, int((math.sqrt(d) - ON_PATH_M) / step_m))
    if best > ON_PATH_M * ON_PATH_M:
        return -1.0, 0.0, 0.0
    yaw = paths[at, 2]
    dx, dy = x - paths[at, 0], y - paths[at, 1]
    cy, sy = cos_sin(yaw)
    return (at - first) * step_m + dx * cy + dy * sy, dy * cy - dx * sy, yaw


@inner
def _fill(row: Floats, yaw: float, path_yaw: float, v: float, length: float, width: float) -> None:
    """Write a body's extent along and across the path and its speed along the path to a row of the survey."""
    turn = yaw - path_yaw
    along, beside = cos_sin(turn)
    ct, st = abs(along), abs(beside)
    row[c.S_LENGTH], row[c.S_WIDTH] = ct * length + st * width, ct * width + st * length
    row[c.S_SPEED] = max(0.0, v * along)


@inner
def _is_driven(ints: Ints, path: int) -> bool:
    """Return whether anybody drives on this path."""
    for i in range(len(ints)):
        if ints[i, c.I_PATH] == path and ints[i, c.I_ACTIVE] == c.PRESENT and ints[i, c.I_MODE] == c.MODE_DRIVE:
            return True
    return False


@inner
def survey(world: WorldArrays) -> None:
    """Fill `world.survey` for every path that is driven on; bodies are the actors and, last, the ego."""
    ints, ego, paths = world.actor_ints, world.ego, world.paths
    count = len(ints)
    for path in range(len(world.path_start) - 1):
        if not _is_driven(ints, path):
            continue
        first, last, step = world.path_start[path], world.path_start[path + 1], world.path_step[path]
        for i in range(count):
            actor, row = world.actors[i], world.survey[path, i]
            if ints[i, c.I_ACTIVE] != c.PRESENT or ints[i, c.I_SOLID] == 0:
                row[c.S_ALONG] = -1.0
            elif ints[i, c.I_PATH] == path and ints[i, c.I_MODE] == c.MODE_DRIVE:
                row[c.S_ALONG], row[c.S_RIGHT] = actor[c.A_ALONG_M], actor[c.A_RIGHT_M]
                row[c.S_LENGTH], row[c.S_WIDTH], row[c.S_SPEED] = actor[c.A_LENGTH], actor[c.A_WIDTH], actor[c.A_V]
            else:
                row[c.S_ALONG], row[c.S_RIGHT], yaw = _project(paths, first, last, step, actor[c.A_X], actor[c.A_Y])
                if row[c.S_ALONG] >= 0.0:
                    _fill(row, actor[c.A_YAW], yaw, actor[c.A_V], actor[c.A_LENGTH], actor[c.A_WIDTH])
        row = world.survey[path, count]
        row[c.S_ALONG], row[c.S_RIGHT], yaw = _project(paths, first, last, step, ego[c.EGO_X], ego[c.EGO_Y])
        if row[c.S_ALONG] >= 0.0:
            _fill(row, ego[c.EGO_YAW], yaw, ego[c.EGO_V], world.ego_length_m, world.ego_width_m)


@inner
def path_pose(world: WorldArrays, path: int, s: float, right_m: float) -> tuple[float, float, float]:
    """Return x, y, yaw of a point `s` metres along a path and `right_m` to its right."""
    paths, first, last = world.paths, world.path_start[path], world.path_start[path + 1]
    share = s / world.path_step[path]
    index = int(min(max(math.floor(share), 0.0), last - first - 2.0))
    share -= index
    k = first + index
    x = paths[k, 0] + share * (paths[k + 1, 0] - paths[k, 0])
    y = paths[k, 1] + share * (paths[k + 1, 1] - paths[k, 1])
    bounded = min(max(share, 0.0), 1.0)
    yaw = paths[k, 2] + bounded * (paths[k + 1, 2] - paths[k, 2])
    along, beside = cos_sin(yaw)
    return x - right_m * beside, y + right_m * along, yaw
