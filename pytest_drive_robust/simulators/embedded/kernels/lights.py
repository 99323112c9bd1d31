"""What the lights show."""

from __future__ import annotations

from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

__all__ = ["set_lights"]

_STOP_SIGN = int(LightState.STOP_SIGN)


@inner
def set_lights(world: WorldArrays) -> None:
    """Set every light to the phase of its program that has come since the scenario started; stop signs stay."""
    since = -1.0 if world.clock[1] < 0 else (world.clock[0] - world.clock[1]) * world.dt_s
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
