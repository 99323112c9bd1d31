"""How the ego moves: `bicycle`, a kinematic one with lags, limits and grip for a car of that size, or CARLA's `mkz`."""

from __future__ import annotations

import math

from pytest_drive_robust.arithmetic.compiled import atan, cos, cos_sin, exp, tan, wrap_angle
from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.mkz import MKZ_STEER_MAX_RAD, mkz_speed, mkz_turn
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
def turning(world: WorldArrays, speed_mps: float) -> tuple[float, float]:
    """Return the angle from the heading to where the middle moves, and the yaw rate, as the wheels are turned now."""
    wheel = world.ego[c.EGO_STEER]
    if world.vehicle == c.VEHICLE_MKZ:
        return mkz_turn(speed_mps, wheel)
    slip = atan(0.5 * tan(wheel))
    yaw_rate = speed_mps * cos(slip) * tan(wheel) / WHEELBASE_M
    if abs(yaw_rate) * speed_mps > GRIP_MPS2:
        yaw_rate = math.copysign(GRIP_MPS2 / speed_mps, yaw_rate)
        slip = 0.0
    return slip, yaw_rate


@inner
def _drive_bicycle(world: WorldArrays, throttle: float, steer: float, brake: float) -> float:
    """Turn the wheels, with a rate and a lag, and return the speed after the tick: engine power, drag, brake lag."""
    ego, dt, v = world.ego, world.dt_s, world.ego[c.EGO_V]
    wanted = steer * STEER_MAX_RAD - ego[c.EGO_STEER]
    turn = wanted * (1.0 - exp(-dt / STEER_LAG_S))
    ego[c.EGO_STEER] += min(max(turn, -STEER_RATE_RADPS * dt), STEER_RATE_RADPS * dt)
    push = throttle * min(ACCEL_MAX_MPS2, POWER_WPKG / max(v, 1.0)) if brake <= 0.0 else 0.0
    drag = 0.12 + 0.018 * v + 0.0006 * v * v
    command = push - brake * BRAKE_MAX_MPS2
    lag = BRAKE_LAG_S if command < ego[c.EGO_ACCEL] else DRIVE_LAG_S
    ego[c.EGO_ACCEL] += (command - ego[c.EGO_ACCEL]) * (1.0 - exp(-dt / lag))
    moving = drag if v > 0.0 or ego[c.EGO_ACCEL] > drag else max(ego[c.EGO_ACCEL], 0.0)
    return float(max(0.0, v + (ego[c.EGO_ACCEL] - moving) * dt))


@inner
def move_ego(world: WorldArrays, throttle: float, steer: float, brake: float) -> None:
    """Move the ego with the speed in the middle of the tick; CARLA's fits are made for that at its start. v >= 0."""
    throttle, steer = _on_dirt(world, throttle, steer)
    ego = world.ego
    dt, v = world.dt_s, ego[c.EGO_V]
    if world.vehicle == c.VEHICLE_MKZ:
        ego[c.EGO_STEER] = steer * MKZ_STEER_MAX_RAD
        after = mkz_speed(v, throttle, brake)
        ego[c.EGO_ACCEL] = (after - v) / dt
        mean, half = v, 0.0
    else:
        after = _drive_bicycle(world, throttle, steer, brake)
        mean, half = 0.5 * (v + after), 0.5
    slip, yaw_rate = turning(world, mean)
    direction = ego[c.EGO_YAW] + slip + half * yaw_rate * dt
    along, beside = cos_sin(direction)
    ego[c.EGO_X] += mean * along * dt
    ego[c.EGO_Y] += mean * beside * dt
    ego[c.EGO_YAW] = wrap_angle(ego[c.EGO_YAW] + yaw_rate * dt)
    ego[c.EGO_FORWARD], ego[c.EGO_RIGHT], ego[c.EGO_YAW_RATE] = (after - v) / dt, mean * yaw_rate, yaw_rate
    ego[c.EGO_V] = after
