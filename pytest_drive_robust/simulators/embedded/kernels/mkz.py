"""Response of CARLA's Lincoln MKZ 2020 to controls, as fitted by the expert planners from driving at 20 Hz.

Source: PDM-Lite, SimLingo `Bench2Drive/leaderboard/team_code/config.py` and `kinematic_bicycle_model.py`; the steering
is the fit of World on Rails. The constants hold for ticks of 50 ms. The wheels turn at once. Outside the range of a fit
a smooth continuation applies:

* Throttle below 0.3: linear down to coasting, which is 0.5 m/s2 less than throttle 0.3.
* Throttle below 0.5 above 18 m/s, where the fit lets less throttle accelerate again: throttle 0.3 stays at what it is
  at 18 m/s (-0.95 m/s2), and from there to throttle 0.5 what is beyond it fades out.
* Above 25 m/s: what holds at 25 m/s, less 0.1 m/s2 for each m/s beyond.
* Brakes between 0 and 1, with or without throttle: in proportion between what the throttle does and full brakes.
* Full brakes below 0.05 km/h: coasting, which comes to rest. Nothing ever reverses, and at rest the throttle pulls
  from 0.16 on.
* Lateral acceleration beyond 7 m/s2: the tyres give way, towards 10 m/s2 at most. The fit knows no limit.
"""

from __future__ import annotations

from pytest_drive_robust.arithmetic.compiled import atan, sin, tan
from pytest_drive_robust.jit.kernels import inner

MKZ_STEER_MAX_RAD = 0.36848336
MKZ_REAR_M, MKZ_FRONT_M = 1.4178275, -0.090769015
LEAST_THROTTLE, COAST_KMH, LEAN_THROTTLE, LEAN_KMH = 0.3, 0.5 * 3.6 * 0.05, 0.5, 64.8
MOST_KMH, FALL_OFF = 90.0, 0.1 * 0.05
GRIP_FROM_MPS2, GRIP_TO_MPS2 = 7.0, 10.0


@inner
def _pull(kmh: float, u: float) -> float:
    """Return the speed after a tick with throttle `u`, by the fit, in km/h."""
    steady = 0.963873001 * kmh + 4.37535692e-4 * kmh * kmh
    rising = -0.380192912 + 0.0916787414 * kmh - 1.05996152e-3 * kmh * kmh
    bending = 1.74950069 - 0.0705461530 * kmh + 6.71079346e-4 * kmh * kmh
    return steady + (rising + bending * u) * u


@inner
def _after_throttle(kmh: float, throttle: float) -> float:
    u = max(throttle, LEAST_THROTTLE)
    after = _pull(kmh, u)
    if kmh > LEAN_KMH and u < LEAN_THROTTLE:
        beyond = (_pull(kmh, LEAST_THROTTLE) - kmh) - (_pull(LEAN_KMH, LEAST_THROTTLE) - LEAN_KMH)
        after -= max(beyond, 0.0) * (LEAN_THROTTLE - u) / (LEAN_THROTTLE - LEAST_THROTTLE)
    return after - COAST_KMH * max(1.0 - throttle / LEAST_THROTTLE, 0.0)


@inner
def _after_brakes(kmh: float) -> float:
    """Return the speed after a tick with full brakes, by the fit, in km/h."""
    after = 2.44419284e-9 - 4.91381935e-12 * kmh
    for factor in (-4.90357228e-7, 5.06587474e-5, -2.83832427e-3, 0.0820967431, 9.31711370e-3):
        after = factor + after * kmh
    return after * kmh


@inner
def mkz_speed(speed_mps: float, throttle: float, brake: float) -> float:
    """Return the speed after a tick in m/s, never below 0."""
    kmh = 3.6 * speed_mps
    fitted = min(kmh, MOST_KMH)
    after = _after_throttle(fitted, throttle)
    if brake > 0.0:
        after += brake * (min(_after_brakes(fitted), _after_throttle(fitted, 0.0)) - after)
    return max(after + (kmh - fitted) * (1.0 - FALL_OFF), 0.0) / 3.6


@inner
def mkz_turn(speed_mps: float, wheel_rad: float) -> tuple[float, float]:
    """Return the slip angle at the ego's middle (heading to direction of motion) [rad] and the yaw rate [rad/s]."""
    slip = atan(MKZ_REAR_M / (MKZ_FRONT_M + MKZ_REAR_M) * tan(wheel_rad))
    yaw_rate = speed_mps / MKZ_REAR_M * sin(slip)
    beyond = (abs(yaw_rate) * speed_mps - GRIP_FROM_MPS2) / (GRIP_TO_MPS2 - GRIP_FROM_MPS2)
    if beyond > 0.0:
        kept = (GRIP_FROM_MPS2 + (GRIP_TO_MPS2 - GRIP_FROM_MPS2) * beyond / (1.0 + beyond)) / (
            abs(yaw_rate) * speed_mps
        )
        slip, yaw_rate = slip * kept, yaw_rate * kept
    return slip, yaw_rate
