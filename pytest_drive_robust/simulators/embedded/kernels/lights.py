"""What the lights show."""

from __future__ import annotations

from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.simulators.embedded.jit import inner
from pytest_drive_robust.simulators.embedded.state import State, Statics

__all__ = ["set_lights"]

_STOP_SIGN = int(LightState.STOP_SIGN)


@inner
def set_lights(statics: Statics, state: State) -> None:
    """Set every light to the phase of its program that has come since the scenario woke up; stop signs stay."""
    since = -1.0 if state.clock[1] < 0 else (state.clock[0] - state.clock[1]) * statics.dt_s
    for k in range(len(state.lights)):
        if statics.stop_is_light[k] == 0:
            state.lights[k] = _STOP_SIGN
        elif since < 0.0:
            state.lights[k] = statics.light_before[k]
        else:
            phases = statics.light_until_s.shape[1]
            phase = 0
            while phase < phases - 1 and since >= statics.light_until_s[k, phase]:
                phase += 1
            state.lights[k] = statics.light_states[k, phase]
