"""What triggers set off."""

from __future__ import annotations

import math

from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.jit import inner
from pytest_drive_robust.simulators.embedded.state import State, Statics

__all__ = ["run_script"]


@inner
def _fires(statics: Statics, state: State, i: int) -> bool:
    """Return whether the trigger of actor i has come, after the scenario woke up."""
    if state.clock[1] < 0:
        return False
    actor = state.actors[i]
    kind = state.actor_ints[i, c.I_TRIGGER]
    if kind == c.TRIGGER_PROGRESS:
        return bool(statics.route_s[state.criteria_ints[c.CI_PROGRESS]] >= actor[c.A_TRIGGER_PROGRESS_M])
    if kind == c.TRIGGER_ARRIVAL:
        away = math.hypot(state.ego[c.EGO_X] - actor[c.A_TRIGGER_X], state.ego[c.EGO_Y] - actor[c.A_TRIGGER_Y])
        v = state.ego[c.EGO_V]
        return bool(away < actor[c.A_TRIGGER_M] or (v > 0.5 and away / v < actor[c.A_TRIGGER_TTA_S]))
    return True


@inner
def run_script(statics: Statics, state: State, i: int) -> None:
    """Advance what a trigger sets off: waiting -> delayed -> script -> done."""
    actor, whole = state.actors[i], state.actor_ints[i]
    phase = whole[c.I_PHASE]
    if phase == c.PHASE_WAITING and _fires(statics, state, i):
        phase, actor[c.A_TIMER_S] = c.PHASE_DELAYED, actor[c.A_DELAY_S]
    if phase == c.PHASE_DELAYED:
        actor[c.A_TIMER_S] -= statics.dt_s
        if actor[c.A_TIMER_S] <= 0.0:
            phase, actor[c.A_TIMER_S] = c.PHASE_SCRIPT, actor[c.A_SCRIPT_S]
            if whole[c.I_ACTIVE] == 2:
                whole[c.I_ACTIVE] = 1
                actor[c.A_V] = 0.0 if whole[c.I_MODE] == c.MODE_STATIC else state.ego[c.EGO_V]
            scale = state.ego[c.EGO_V] if whole[c.I_RELATIVE] == 1 else 1.0
            actor[c.A_TARGET_V] = actor[c.A_SCRIPT_V] * scale
            actor[c.A_TARGET_LAT] = actor[c.A_SCRIPT_LAT]
            actor[c.A_SYNC_M] = 0.0
    elif phase == c.PHASE_SCRIPT:
        actor[c.A_TIMER_S] -= statics.dt_s
        if actor[c.A_TIMER_S] <= 0.0:
            phase = c.PHASE_DONE
            actor[c.A_TARGET_V] = actor[c.A_AFTER_V]
    whole[c.I_PHASE] = phase
