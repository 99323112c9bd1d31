"""Move the ego like CARLA's Lincoln MKZ (`mkz`), with the effect of dirt on the road on its controls."""

from __future__ import annotations

from pytest_drive_robust.arithmetic.compiled import cos_sin, wrap_angle
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.mkz import MKZ_STEER_MAX_RAD, mkz_speed, mkz_turn
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

DIRT_M = 2.0


@inner
def _on_dirt(world: WorldArrays, throttle: float, steer: float) -> tuple[float, float]:
    """Return (throttle, steer) after the noise of dirt within `DIRT_M` of the ego."""
    for k in range(len(world.patches)):
        dx, dy = world.patches[k, 0] - world.ego[c.EGO_X], world.patches[k, 1] - world.ego[c.EGO_Y]
        if dx * dx + dy * dy < DIRT_M * DIRT_M:
            noise = world.patch_noise[k, world.clock[c.TICK] % world.patch_noise.shape[1]]
            throttle = min(max(throttle + noise[0], 0.0), 1.0)
            steer = min(max(steer + noise[1], -1.0), 1.0)
            break
    return throttle, steer


@inner
def move_ego(world: WorldArrays, throttle: float, steer: float, brake: float) -> None:
    """Move the ego with its speed at the start of the tick (v >= 0), for which the fits are made.

    Contacts may take speed from the ego, so its acceleration is known only after `contacts`.
    """
    throttle, steer = _on_dirt(world, throttle, steer)
    ego = world.ego
    dt, v = world.dt_s, ego[c.EGO_V]
    ego[c.EGO_STEER] = steer * MKZ_STEER_MAX_RAD
    after = mkz_speed(v, throttle, brake)
    slip, yaw_rate = mkz_turn(v, ego[c.EGO_STEER])
    along, beside = cos_sin(ego[c.EGO_YAW] + slip)
    ego[c.EGO_X] += v * along * dt
    ego[c.EGO_Y] += v * beside * dt
    ego[c.EGO_YAW] = wrap_angle(ego[c.EGO_YAW] + yaw_rate * dt)
    ego[c.EGO_RIGHT], ego[c.EGO_YAW_RATE] = v * yaw_rate, yaw_rate
    ego[c.EGO_V] = after
