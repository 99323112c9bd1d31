"""CARLA's Lincoln MKZ forwards and backwards: from pedals to speed, from a wanted acceleration to pedals.

The numbers are those of the embedded world's `mkz` (`simulators.embedded.kernels.mkz` tells their sources, and what
holds where the fits say nothing). Speeds are in km/h, changes in km/h per tick of 50 ms, as in the fits.
"""

from __future__ import annotations

import math

__all__ = ["FRONT_M", "REAR_M", "STEER_MAX_RAD", "pedals", "speed_after"]

STEER_MAX_RAD = 0.36848336
REAR_M, FRONT_M = 1.4178275, -0.090769015
"""From the middle to the axles, forward."""
_LEAST, _COAST = 0.3, 0.5 * 3.6 * 0.05
_LEAN, _LEAN_KMH = 0.5, 64.8
_MOST_KMH, _FALL_OFF = 90.0, 0.1 * 0.05
_BRAKES = (2.44419284e-9, -4.90357228e-7, 5.06587474e-5, -2.83832427e-3, 0.0820967431, 9.31711370e-3)


def pedals(speed_mps: float, acceleration_mps2: float) -> tuple[float, float]:
    """Return the throttle and the brake (0..1) that give an acceleration in the next tick, or the nearest there is."""
    kmh = min(3.6 * speed_mps, _MOST_KMH)
    wanted = 3.6 * 0.05 * acceleration_mps2 + _FALL_OFF * (3.6 * speed_mps - kmh)
    least = _gained(kmh)
    if wanted < least - _COAST:
        coasting = max(kmh + least - _COAST, 0.0)
        brakes = min(_after_brakes(kmh), coasting)
        if coasting <= brakes:
            return 0.0, 1.0
        return 0.0, min((least - _COAST - wanted) / (coasting - brakes), 1.0)
    if wanted <= least:
        return _LEAST * (1.0 - (least - wanted) / _COAST), 0.0
    steady, rising, bending = _throttle_terms(kmh)
    beyond = _beyond(kmh)
    lean = steady - kmh + (rising + bending * _LEAN) * _LEAN
    if beyond > 0.0 and wanted < lean:  # between throttle 0.3 and 0.5 what is beyond fades out
        fades = beyond / (_LEAN - _LEAST)
        return _root(steady - kmh - fades * _LEAN - wanted, rising + fades, bending), 0.0
    return _root(steady - kmh - wanted, rising, bending), 0.0


def speed_after(speed_mps: float, throttle: float, brake: float) -> float:
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
    """Return what throttle 0.3 gains in a tick, by the fit alone."""
    steady, rising, bending = _throttle_terms(kmh)
    return steady - kmh + (rising + bending * _LEAST) * _LEAST


def _beyond(kmh: float) -> float:
    return max(_fitted(kmh) - _fitted(_LEAN_KMH), 0.0) if kmh > _LEAN_KMH else 0.0


def _gained(kmh: float) -> float:
    """Return what throttle 0.3 gains in a tick."""
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
