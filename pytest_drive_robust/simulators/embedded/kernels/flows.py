"""Sources that send one car after the other."""

from __future__ import annotations

from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.paths import path_pose
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

__all__ = ["fill_flows", "run_flows"]

JUNCTION_M, STOPPING_MPS2 = 30.0, 3.0
_GREEN = int(LightState.GREEN)


@inner
def run_flows(world: WorldArrays) -> None:
    """Let each source send its next car once the last one is farther away than the drawn gap."""
    for f in range(len(world.flows)):
        flow, whole = world.flows[f], world.flow_ints[f]
        latest = whole[c.FI_LATEST]
        on_road = latest >= 0 and world.actor_ints[latest, c.I_ACTIVE] == 1
        if on_road and world.actors[latest, c.A_S] - flow[c.F_SOURCE_S] < flow[c.F_NEXT_GAP_M]:
            continue
        slot = -1
        for k in range(whole[c.FI_FIRST_SLOT], whole[c.FI_LAST_SLOT]):
            if world.actor_ints[k, c.I_ACTIVE] == 0:
                slot = k
                break
        if slot < 0:
            continue
        _spawn(world, f, slot, flow[c.F_SOURCE_S])


@inner
def _spawn(world: WorldArrays, f: int, slot: int, s: float) -> None:
    flow, whole = world.flows[f], world.flow_ints[f]
    actor = world.actors[slot]
    lat = flow[c.F_LAT]
    actor[c.A_S], actor[c.A_LAT], actor[c.A_V], actor[c.A_ACCEL] = s, lat, flow[c.F_SPEED], 0.0
    actor[c.A_TARGET_V], actor[c.A_TARGET_LAT], actor[c.A_END_S] = flow[c.F_SPEED], lat, flow[c.F_SINK_S]
    path = whole[c.FI_PATH]
    first, last, step = world.path_start[path], world.path_start[path + 1], world.path_step[path]
    actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = path_pose(world.paths, first, last, step, s, lat)
    world.actor_ints[slot, c.I_ACTIVE] = 1
    world.actor_ints[slot, c.I_STUN] = 0
    world.actor_ints[slot, c.I_LAST_HIT] = -100000
    whole[c.FI_LATEST] = slot
    flow[c.F_NEXT_GAP_M] = world.flow_gaps[f, whole[c.FI_DRAWN] % world.flow_gaps.shape[1]]
    whole[c.FI_DRAWN] += 1


@inner
def fill_flows(world: WorldArrays) -> None:
    """Fill every flow at the start, from its sink back to its source."""
    for f in range(len(world.flows)):
        flow, whole = world.flows[f], world.flow_ints[f]
        s = flow[c.F_SINK_S] - 5.0
        for slot in range(whole[c.FI_FIRST_SLOT], whole[c.FI_LAST_SLOT]):
            if s < flow[c.F_SOURCE_S]:
                break
            _spawn(world, f, slot, s)
            if _runs_red_light(world, whole[c.FI_PATH], slot, s):
                world.actor_ints[slot, c.I_ACTIVE] = 0
            s -= flow[c.F_NEXT_GAP_M]


@inner
def _runs_red_light(world: WorldArrays, path: int, slot: int, s: float) -> bool:
    """Return whether a driver who obeys lights starts where he cannot stop for a red one, or within its junction."""
    line = world.path_stop_line[path]
    if line < 0 or world.actor_ints[slot, c.I_OBEYS_LIGHTS] == 0 or world.lights[line] == _GREEN:
        return False
    v, before = world.actors[slot, c.A_V], world.path_stop_s[path] - s - 0.5 * world.actors[slot, c.A_LENGTH]
    return bool(-JUNCTION_M < before < 0.5 * v * v / STOPPING_MPS2)
