"""What triggers set off."""

from __future__ import annotations

from pytest_drive_robust.arithmetic.compiled import hypot
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

__all__ = ["run_script"]


@inner
def _fires(world: WorldArrays, i: int) -> bool:
    """Return whether the trigger of actor i has come, after the scenario started."""
    if world.clock[1] < 0:
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
    """Advance what a trigger sets off: waiting -> delayed -> script -> done."""
    actor, whole = world.actors[i], world.actor_ints[i]
    phase = whole[c.I_PHASE]
    if phase == c.PHASE_WAITING and _fires(world, i):
        phase, actor[c.A_TIMER_S] = c.PHASE_DELAYED, actor[c.A_DELAY_S]
    if phase == c.PHASE_DELAYED:
        actor[c.A_TIMER_S] -= world.dt_s
        if actor[c.A_TIMER_S] <= 0.0:
            phase, actor[c.A_TIMER_S] = c.PHASE_SCRIPT, actor[c.A_SCRIPT_S]
            if whole[c.I_ACTIVE] == 2:
                whole[c.I_ACTIVE] = 1
                actor[c.A_V] = 0.0 if whole[c.I_MODE] == c.MODE_STATIC else world.ego[c.EGO_V]
            scale = world.ego[c.EGO_V] if whole[c.I_RELATIVE] == 1 else 1.0
            actor[c.A_TARGET_V] = actor[c.A_SCRIPT_V] * scale
            actor[c.A_TARGET_LAT] = actor[c.A_SCRIPT_LAT]
            actor[c.A_SYNC_M] = 0.0
    elif phase == c.PHASE_SCRIPT:
        actor[c.A_TIMER_S] -= world.dt_s
        if actor[c.A_TIMER_S] <= 0.0:
            phase = c.PHASE_DONE
            actor[c.A_TARGET_V] = actor[c.A_AFTER_V]
    whole[c.I_PHASE] = phase
