"""Run the scenario: its start and its end, lights, flows of cars, and the scripts of actors."""

from __future__ import annotations

from pytest_drive_robust.arithmetic.compiled import hypot
from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.paths import path_pose
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

TRIGGER_RADIUS_M = 2.0
"""Metres before the trigger point at which the scenario starts."""
JUNCTION_M, STOPPING_MPS2 = 30.0, 3.0
"""Length of a junction behind its stop line, and how hard a driver brakes for a light, when flows are filled."""
_GREEN = int(LightState.GREEN)
_STOP_SIGN = int(LightState.STOP_SIGN)


@inner
def start_and_end(world: WorldArrays) -> None:
    """Start the scenario when the ego comes to the trigger, and end it at its end."""
    s = world.route_s[world.criteria_ints[c.CI_PROGRESS]]
    if world.clock[c.STARTED] < 0 and s >= world.trigger_m - TRIGGER_RADIUS_M:
        world.clock[c.STARTED] = world.clock[c.TICK]
    if world.clock[c.STARTED] >= 0 and s >= world.scenario_end_m:
        world.criteria_ints[c.CI_SCENARIO_OVER] = 1


@inner
def scenario_runs(world: WorldArrays) -> bool:
    """Return whether the scenario has started and is not over."""
    return bool(world.clock[c.STARTED] >= 0 and world.criteria_ints[c.CI_SCENARIO_OVER] == 0)


@inner
def run_flows(world: WorldArrays) -> None:
    """Let each flow send its next car once the last car is farther away than the drawn gap."""
    for f in range(len(world.flows)):
        flow, whole = world.flows[f], world.flow_ints[f]
        latest = whole[c.FI_LATEST]
        on_road = latest >= 0 and world.actor_ints[latest, c.I_ACTIVE] == c.PRESENT
        if on_road and world.actors[latest, c.A_ALONG_M] - flow[c.F_SOURCE_M] < flow[c.F_NEXT_GAP_M]:
            continue
        slot = -1
        for k in range(whole[c.FI_FIRST_SLOT], whole[c.FI_LAST_SLOT]):
            if world.actor_ints[k, c.I_ACTIVE] == c.ABSENT:
                slot = k
                break
        if slot < 0:
            continue
        _spawn(world, f, slot, flow[c.F_SOURCE_M])


@inner
def _spawn(world: WorldArrays, f: int, slot: int, s: float) -> None:
    """Put the next car of flow f, the actor `slot`, `s` metres along its path; draw the gap to the car after it."""
    flow, whole = world.flows[f], world.flow_ints[f]
    actor = world.actors[slot]
    lat = flow[c.F_RIGHT_M]
    actor[c.A_ALONG_M], actor[c.A_RIGHT_M], actor[c.A_V], actor[c.A_ACCEL] = s, lat, flow[c.F_SPEED], 0.0
    actor[c.A_TARGET_V], actor[c.A_TARGET_RIGHT_M], actor[c.A_END_M] = flow[c.F_SPEED], lat, flow[c.F_SINK_M]
    actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = path_pose(world, whole[c.FI_PATH], s, lat)
    world.actor_ints[slot, c.I_ACTIVE] = c.PRESENT
    world.actor_ints[slot, c.I_STUN] = 0
    world.actor_ints[slot, c.I_LAST_HIT] = c.NEVER_HIT
    whole[c.FI_LATEST] = slot
    flow[c.F_NEXT_GAP_M] = world.flow_gaps[f, whole[c.FI_DRAWN] % world.flow_gaps.shape[1]]
    whole[c.FI_DRAWN] += 1


@inner
def fill_flows(world: WorldArrays) -> None:
    """Fill every flow at the start, from its sink back to its source."""
    for f in range(len(world.flows)):
        flow, whole = world.flows[f], world.flow_ints[f]
        s = flow[c.F_SINK_M] - 5.0
        for slot in range(whole[c.FI_FIRST_SLOT], whole[c.FI_LAST_SLOT]):
            if s < flow[c.F_SOURCE_M]:
                break
            _spawn(world, f, slot, s)
            if _runs_red_light(world, whole[c.FI_PATH], slot, s):
                world.actor_ints[slot, c.I_ACTIVE] = c.ABSENT
            s -= flow[c.F_NEXT_GAP_M]


@inner
def _runs_red_light(world: WorldArrays, path: int, slot: int, s: float) -> bool:
    """Return whether a driver who obeys lights would start too near a red light to stop, or within its junction."""
    line = world.path_stop_line[path]
    if line < 0 or world.actor_ints[slot, c.I_OBEYS_LIGHTS] == 0 or world.lights[line] == _GREEN:
        return False
    v, before = world.actors[slot, c.A_V], world.path_stop_m[path] - s - 0.5 * world.actors[slot, c.A_LENGTH]
    return bool(-JUNCTION_M < before < 0.5 * v * v / STOPPING_MPS2)


@inner
def set_lights(world: WorldArrays) -> None:
    """Set every light to the current phase of its program, counted from the scenario's start; stop signs stay."""
    since = -1.0 if world.clock[c.STARTED] < 0 else (world.clock[c.TICK] - world.clock[c.STARTED]) * world.dt_s
    for k in range(len(world.lights)):
        if world.stop_is_light[k] == 0:
            world.lights[k] = _STOP_SIGN
        elif since < 0.0:
            world.lights[k] = world.light_before[k]
        else:
            phases = world.light_until_s.shape[1]
            phase = 0
            while phase < phases - 1 and since >= world.light_until_s[k, phase]:
                phase += 1
            world.lights[k] = world.light_states[k, phase]


@inner
def _fires(world: WorldArrays, i: int) -> bool:
    """Return whether the scenario has started and the trigger of actor i is met."""
    if world.clock[c.STARTED] < 0:
        return False
    actor = world.actors[i]
    kind = world.actor_ints[i, c.I_TRIGGER]
    if kind == c.TRIGGER_PROGRESS:
        return bool(world.route_s[world.criteria_ints[c.CI_PROGRESS]] >= actor[c.A_TRIGGER_PROGRESS_M])
    if kind == c.TRIGGER_ARRIVAL:
        away = hypot(world.ego[c.EGO_X] - actor[c.A_TRIGGER_X], world.ego[c.EGO_Y] - actor[c.A_TRIGGER_Y])
        v = world.ego[c.EGO_V]
        return bool(away < actor[c.A_TRIGGER_M] or (v > 0.5 and away / v < actor[c.A_TRIGGER_TTA_S]))
    return True


@inner
def run_script(world: WorldArrays, i: int) -> None:
    """Advance the script of actor i: waiting -> delayed -> script -> done."""
    actor, whole = world.actors[i], world.actor_ints[i]
    phase = whole[c.I_PHASE]
    if phase == c.PHASE_WAITING and _fires(world, i):
        phase, actor[c.A_TIMER_S] = c.PHASE_DELAYED, actor[c.A_DELAY_S]
    if phase == c.PHASE_DELAYED:
        actor[c.A_TIMER_S] -= world.dt_s
        if actor[c.A_TIMER_S] <= 0.0:
            phase, actor[c.A_TIMER_S] = c.PHASE_SCRIPT, actor[c.A_SCRIPT_S]
            if whole[c.I_ACTIVE] == c.NOT_YET:
                whole[c.I_ACTIVE] = c.PRESENT
                actor[c.A_V] = 0.0 if whole[c.I_MODE] == c.MODE_STATIC else world.ego[c.EGO_V]
            scale = world.ego[c.EGO_V] if whole[c.I_RELATIVE] == c.SPEED_SHARE else 1.0
            actor[c.A_TARGET_V] = actor[c.A_SCRIPT_V] * scale
            actor[c.A_TARGET_RIGHT_M] = actor[c.A_SCRIPT_RIGHT_M]
            actor[c.A_SYNC_M] = 0.0
    elif phase == c.PHASE_SCRIPT:
        actor[c.A_TIMER_S] -= world.dt_s
        if actor[c.A_TIMER_S] <= 0.0:
            phase = c.PHASE_DONE
            actor[c.A_TARGET_V] = actor[c.A_AFTER_V]
    whole[c.I_PHASE] = phase
