"""Model of the driven car and its inverse: from controls to motion, and from wanted motion to controls.

The car is CARLA's Lincoln MKZ with the numbers of the embedded world (`simulators.embedded.kernels.mkz` gives their
sources, and the continuation outside of the fits). Agents use this model and never ask the simulator. In private
functions speeds are in km/h, changes in km/h per tick of 50 ms, as in the fits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pytest_drive_robust import Control
from pytest_drive_robust.arithmetic.scalars import atan, sin, tan

__all__ = ["REAR_M", "STEER_MAX_RAD", "TICK_S", "WHEELBASE_M", "Moved", "Pedals", "eased", "moved", "pedals", "steer"]

STEER_MAX_RAD = 0.36848336
"""Wheel angle of a full `steer`, which is reached at once."""
REAR_M = 1.4178275
"""Distance from the rear axle to the middle of the car."""
WHEELBASE_M = -0.090769015 + REAR_M
"""Wheelbase of the fit: with a small wheel angle the middle follows the curvature angle / wheelbase."""
TICK_S = 0.05
"""Seconds between ticks; an observation carries its own tick."""
_EASE = 0.22
"""Share of the way to a higher acceleration per tick: that of an engine with a lag of 0.2 s (`forecast`)."""
_LEAST, _COAST = 0.3, 0.5 * 3.6 * TICK_S
"""Throttle below which the fit does not hold, and what coasting loses in a tick against this throttle [km/h]."""
_LEAN, _LEAN_KMH = 0.5, 64.8
"""Above this speed the fit does not hold below this throttle, as less throttle would accelerate more."""
_MOST_KMH, _FALL_OFF = 90.0, 0.1 * TICK_S
"""Speed above which the fit does not hold, and the share of the speed beyond that is lost in a tick."""
_BRAKES = (2.44419284e-9, -4.90357228e-7, 5.06587474e-5, -2.83832427e-3, 0.0820967431, 9.31711370e-3)


class Pedals(NamedTuple):
    """Throttle and brake, 0 to 1."""

    throttle: float
    brake: float


class Moved(NamedTuple):
    """The effect of a tick: angle from the heading to the middle's motion, turn per m/s, speed afterwards."""

    slip_rad: float
    turn_rad: float
    speed_mps: float


def steer(curvature_per_m: float) -> float:
    """Return the steering (-1..1) for a curvature of the middle's path, or the nearest possible, while tyres hold."""
    sine = min(max(REAR_M * curvature_per_m, -0.9), 0.9)  # beyond the range of the wheels
    tangent = sine / math.sqrt(1.0 - sine * sine)
    wheel = atan(tangent * WHEELBASE_M / REAR_M)
    return min(max(wheel / STEER_MAX_RAD, -1.0), 1.0)


def eased(acceleration_mps2: float, wanted_mps2: float) -> float:
    """Return the acceleration to command in this tick, from the present and the wanted acceleration.

    A lower wanted acceleration is commanded at once, a higher one step by step, as plans expect of an engine. Otherwise
    the plan of one tick would be fully driven before the next plan is made, back and forth.
    """
    return min(wanted_mps2, acceleration_mps2 + _EASE * (wanted_mps2 - acceleration_mps2))


def moved(speed_mps: float, control: Control) -> Moved:
    """Return the effect of a control in a tick, without the limits of grip."""
    slip = atan(REAR_M / WHEELBASE_M * tan(control.steer * STEER_MAX_RAD))
    return Moved(slip, TICK_S * sin(slip) / REAR_M, _speed_after(speed_mps, control.throttle, control.brake))


def pedals(speed_mps: float, acceleration_mps2: float) -> Pedals:
    """Return the pedals that give an acceleration in the next tick, or the nearest there is."""
    kmh = min(3.6 * speed_mps, _MOST_KMH)
    wanted = 3.6 * TICK_S * acceleration_mps2 + _FALL_OFF * (3.6 * speed_mps - kmh)
    least = _gained(kmh)
    if wanted < least - _COAST:
        coasting = max(kmh + least - _COAST, 0.0)
        brakes = min(_after_brakes(kmh), coasting)
        if coasting <= brakes:
            return Pedals(0.0, 1.0)
        return Pedals(0.0, min((least - _COAST - wanted) / (coasting - brakes), 1.0))
    if wanted <= least:
        return Pedals(_LEAST * (1.0 - (least - wanted) / _COAST), 0.0)
    steady, rising, bending = _throttle_terms(kmh)
    beyond = _beyond(kmh)
    lean = steady - kmh + (rising + bending * _LEAN) * _LEAN
    if beyond > 0.0 and wanted < lean:  # between throttle 0.3 and 0.5 the excess fades out
        fades = beyond / (_LEAN - _LEAST)
        return Pedals(_root(steady - kmh - fades * _LEAN - wanted, rising + fades, bending), 0.0)
    return Pedals(_root(steady - kmh - wanted, rising, bending), 0.0)


def _speed_after(speed_mps: float, throttle: float, brake: float) -> float:
    """Return the speed after a tick in m/s."""
    whole = 3.6 * speed_mps
    kmh = min(whole, _MOST_KMH)
    coasting = kmh + _gained(kmh) - _COAST
    after = coasting + _COAST * min(throttle / _LEAST, 1.0)
    if throttle > _LEAST:
        steady, rising, bending = _throttle_terms(kmh)
        fades = _beyond(kmh) * max(_LEAN - throttle, 0.0) / (_LEAN - _LEAST)
        after = steady + (rising + bending * throttle) * throttle - fades
    after += brake * (min(_after_brakes(kmh), coasting) - after)
    return max(after + (whole - kmh) * (1.0 - _FALL_OFF), 0.0) / 3.6


def _throttle_terms(kmh: float) -> tuple[float, float, float]:
    """Return the next speed as a polynomial of the throttle."""
    return (
        0.963873001 * kmh + 4.37535692e-4 * kmh * kmh,
        -0.380192912 + 0.0916787414 * kmh - 1.05996152e-3 * kmh * kmh,
        1.74950069 - 0.0705461530 * kmh + 6.71079346e-4 * kmh * kmh,
    )


def _fitted(kmh: float) -> float:
    """Return the gain of speed with throttle 0.3 in a tick, by the fit alone."""
    steady, rising, bending = _throttle_terms(kmh)
    return steady - kmh + (rising + bending * _LEAST) * _LEAST


def _beyond(kmh: float) -> float:
    return max(_fitted(kmh) - _fitted(_LEAN_KMH), 0.0) if kmh > _LEAN_KMH else 0.0


def _gained(kmh: float) -> float:
    """Return the gain of speed with throttle 0.3 in a tick."""
    return _fitted(kmh) - _beyond(kmh)


def _after_brakes(kmh: float) -> float:
    after = -4.91381935e-12
    for factor in _BRAKES:
        after = factor + after * kmh
    return after * kmh


def _root(constant: float, linear: float, square: float) -> float:
    """Return the throttle at which `constant + linear u + square u2` rises through 0, at most 1."""
    if constant + linear + square <= 0.0:
        return 1.0
    inside = max(linear * linear - 4.0 * constant * square, 0.0)
    return min(max(-2.0 * constant / (linear + math.sqrt(inside)), _LEAST), 1.0)
