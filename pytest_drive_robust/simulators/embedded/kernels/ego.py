"""How the ego moves: a kinematic bicycle with the lags, limits and grip of a Lincoln MKZ sized car."""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic.compiled import atan, cos, cos_sin, exp, tan, wrap_angle
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

WHEELBASE_M = 2.85
STEER_MAX_RAD = 0.61
STEER_RATE_RADPS = 0.9
STEER_LAG_S = 0.10
DRIVE_LAG_S = 0.20
BRAKE_LAG_S = 0.10
ACCEL_MAX_MPS2 = 5.0
POWER_WPKG = 55.0  # the engine's power per kilogram caps acceleration at speed
BRAKE_MAX_MPS2 = 8.0
GRIP_MPS2 = 7.5  # lateral acceleration beyond this is understeer
DIRT_M = 2.0


@inner
def _on_dirt(world: WorldArrays, throttle: float, steer: float) -> tuple[float, float]:
    """Return what dirt within `DIRT_M` of the ego makes of its controls."""
    for k in range(len(world.patches)):
        dx, dy = world.patches[k, 0] - world.ego[c.EGO_X], world.patches[k, 1] - world.ego[c.EGO_Y]
        if dx * dx + dy * dy < DIRT_M * DIRT_M:
            noise = world.patch_noise[world.clock[0] % len(world.patch_noise)]
            throttle = min(max(throttle + noise[0], 0.0), 1.0)
            steer = min(max(steer + noise[1], -1.0), 1.0)
            break
    return throttle, steer


@inner
def move_ego(world: WorldArrays, throttle: float, steer: float, brake: float) -> None:
    """Move the ego: a kinematic bicycle with steering rate and lag, engine power, drag, brake lag; v >= 0."""
    throttle, steer = _on_dirt(world, throttle, steer)
    ego = world.ego
    dt, v = world.dt_s, ego[c.EGO_V]
    wanted = steer * STEER_MAX_RAD - ego[c.EGO_STEER]
    turn = wanted * (1.0 - exp(-dt / STEER_LAG_S))
    ego[c.EGO_STEER] += min(max(turn, -STEER_RATE_RADPS * dt), STEER_RATE_RADPS * dt)
    push = throttle * min(ACCEL_MAX_MPS2, POWER_WPKG / max(v, 1.0)) if brake <= 0.0 else 0.0
    drag = 0.12 + 0.018 * v + 0.0006 * v * v
    command = push - brake * BRAKE_MAX_MPS2
    lag = BRAKE_LAG_S if command < ego[c.EGO_ACCEL] else DRIVE_LAG_S
    ego[c.EGO_ACCEL] += (command - ego[c.EGO_ACCEL]) * (1.0 - exp(-dt / lag))
    moving = drag if v > 0.0 or ego[c.EGO_ACCEL] > drag else max(ego[c.EGO_ACCEL], 0.0)
    after = max(0.0, v + (ego[c.EGO_ACCEL] - moving) * dt)
    slip = atan(0.5 * tan(ego[c.EGO_STEER]))
    mean = 0.5 * (v + after)
    yaw_rate = mean * cos(slip) * tan(ego[c.EGO_STEER]) / WHEELBASE_M
    if abs(yaw_rate) * mean > GRIP_MPS2:
        yaw_rate = math.copysign(GRIP_MPS2 / mean, yaw_rate)
        slip = 0.0
    direction = ego[c.EGO_YAW] + slip + 0.5 * yaw_rate * dt
    along, beside = cos_sin(direction)
    ego[c.EGO_X] += mean * along * dt
    ego[c.EGO_Y] += mean * beside * dt
    ego[c.EGO_YAW] = wrap_angle(ego[c.EGO_YAW] + yaw_rate * dt)
    ego[c.EGO_FORWARD], ego[c.EGO_RIGHT], ego[c.EGO_YAW_RATE] = (after - v) / dt, mean * yaw_rate, yaw_rate
    ego[c.EGO_V] = after
