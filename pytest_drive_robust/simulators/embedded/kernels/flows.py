"""Sources that send one car after the other."""

from __future__ import annotations

from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.jit import inner
from pytest_drive_robust.simulators.embedded.kernels.paths import path_pose
from pytest_drive_robust.simulators.embedded.state import State, Statics

__all__ = ["fill_flows", "run_flows"]


@inner
def run_flows(statics: Statics, state: State) -> None:
    """Let each source send its next car once the last one is farther away than the drawn gap."""
    for f in range(len(state.flows)):
        flow, whole = state.flows[f], state.flow_ints[f]
        latest = whole[c.FI_LATEST]
        on_road = latest >= 0 and state.actor_ints[latest, c.I_ACTIVE] == 1
        if on_road and state.actors[latest, c.A_S] - flow[c.F_SOURCE_S] < flow[c.F_NEXT_GAP_M]:
            continue
        slot = -1
        for k in range(whole[c.FI_FIRST_SLOT], whole[c.FI_LAST_SLOT]):
            if state.actor_ints[k, c.I_ACTIVE] == 0:
                slot = k
                break
        if slot < 0:
            continue
        _spawn(statics, state, f, slot, flow[c.F_SOURCE_S])


@inner
def _spawn(statics: Statics, state: State, f: int, slot: int, s: float) -> None:
    flow, whole = state.flows[f], state.flow_ints[f]
    actor = state.actors[slot]
    lat = flow[c.F_LAT]
    actor[c.A_S], actor[c.A_LAT], actor[c.A_V], actor[c.A_ACCEL] = s, lat, flow[c.F_SPEED], 0.0
    actor[c.A_TARGET_V], actor[c.A_TARGET_LAT], actor[c.A_END_S] = flow[c.F_SPEED], lat, flow[c.F_SINK_S]
    path = whole[c.FI_PATH]
    first, last, step = statics.path_start[path], statics.path_start[path + 1], statics.path_step[path]
    actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = path_pose(statics.paths, first, last, step, s, lat)
    state.actor_ints[slot, c.I_ACTIVE] = 1
    state.actor_ints[slot, c.I_STUN] = 0
    state.actor_ints[slot, c.I_LAST_HIT] = -100000
    whole[c.FI_LATEST] = slot
    flow[c.F_NEXT_GAP_M] = statics.flow_gaps[f, whole[c.FI_DRAWN] % statics.flow_gaps.shape[1]]
    whole[c.FI_DRAWN] += 1


@inner
def fill_flows(statics: Statics, state: State) -> None:
    """Fill every flow at the start, from its sink back to its source."""
    for f in range(len(state.flows)):
        flow, whole = state.flows[f], state.flow_ints[f]
        s = flow[c.F_SINK_S] - 5.0
        for slot in range(whole[c.FI_FIRST_SLOT], whole[c.FI_LAST_SLOT]):
            if s < flow[c.F_SOURCE_S]:
                break
            _spawn(statics, state, f, slot, s)
            s -= flow[c.F_NEXT_GAP_M]
