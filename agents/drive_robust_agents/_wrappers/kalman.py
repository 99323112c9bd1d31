"""SimLingo's position filter, which averages GPS noise out and is misled by a wrong speedometer.

The Kalman filter over position, yaw and speed hardly trusts the GPS (gain 0.014 per tick once settled), fully trusts
the compass and the speedometer, and predicts with a bicycle model driven by the agent's *own last command*. Position
noise therefore averages out within seconds, while a speedometer that reads too low leaves the estimate metres behind
the vehicle.

Noises are as published (SimLingo `team_code/agent_simlingo.py`). The bicycle model is the car of the embedded world, or
that of the published filter (`published_motion`). The published filter is unscented, this filter is extended: with
practically noiseless yaw and speed both predictions agree. Our car moves at once, so the published 40 ticks of
pretended braking at the start are left out.

The published filter advances by 0.05 s in every call, whatever time has passed. Called only every few ticks, as under
latency in the mode `hold`, its estimate falls behind the vehicle: on a straight road at 8 m/s by 25 m after 20 s, when
called every second tick. `PositionFilter.step` accepts the number of ticks instead (`SimLingo.position_filter`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from drive_robust_agents._vehicle import mkz
from drive_robust_agents._vehicle.mkz import Moved
from pytest_drive_robust import Control
from pytest_drive_robust.arithmetic import scalars

__all__ = ["Motion", "PoseEstimate", "PositionFilter", "published_motion"]

_FIRST = (0.5, 0.5, 1e-6, 1e-6)
_MEASURED = (0.5, 0.5, 1e-15, 1e-15)
_DRIFT = (1e-4, 1e-4, 1e-3, 1e-3)
"""Variances of x, y [m2], yaw [rad2] and speed [m2/s2]: at the start, of a measurement, of one tick's prediction."""

_THROTTLE_MPS2, _BRAKE_MPS2 = 0.5633837, 4.952399

_Matrix = list[list[float]]


class PoseEstimate(NamedTuple):
    """Estimated pose and speed of the vehicle: metres in the route's frame, radians clockwise from east, m/s."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float


Motion = Callable[[float, Control], Moved]
"""A function of the speed in m/s and a control that returns the effect of the control in a tick."""


def published_motion(speed_mps: float, control: Control) -> Moved:
    """Return a tick of CARLA's car in the published filter's model (`bicycle_model_forward`, World on Rails' fit).

    The car turns as in `mkz.moved`. Any brake decelerates by 4.952399 m/s2, else the throttle gives up to 0.5633837
    m/s2. Both hardly matter, because the filter trusts the speedometer.
    """
    push = -_BRAKE_MPS2 if control.brake > 0.0 else _THROTTLE_MPS2 * control.throttle
    return mkz.moved(speed_mps, control)._replace(speed_mps=max(speed_mps + mkz.TICK_S * push, 0.0))


class PositionFilter:
    """Predicts by the last command, then corrects by GPS, compass and speedometer; one object per episode.

    The first estimate is the first measurement. `motion` models the effect of commands.
    """

    def __init__(self, motion: Motion = mkz.moved) -> None:
        self._motion = motion
        self._state: PoseEstimate | None = None
        self._spread: _Matrix = [[_FIRST[i] if i == j else 0.0 for j in range(4)] for i in range(4)]

    def step(
        self, x_m: float, y_m: float, yaw_rad: float, speed_mps: float, last: Control, ticks: int = 1
    ) -> PoseEstimate:
        """Estimate the pose in this tick from its measurements and the agent's last control, given `ticks` ago.

        Ticks in between have no measurement. A compass value of NaN is ignored.
        """
        measured = (x_m, y_m, yaw_rad, speed_mps)
        if self._state is None:
            yaw = 0.0 if math.isnan(yaw_rad) else yaw_rad
            self._state = PoseEstimate(x_m, y_m, yaw, speed_mps)
            return self._state
        state, spread = list(self._state), self._spread
        for _ in range(ticks):
            state, spread = _predicted(self._motion, state, last, spread)
        for k, value in enumerate(measured):
            if not math.isnan(value):
                away = value - state[k]
                state, spread = _corrected(state, spread, k, math.remainder(away, math.tau) if k == 2 else away)
        self._spread = spread
        x, y, yaw, speed = state
        self._state = PoseEstimate(x, y, math.remainder(yaw, math.tau), speed)
        return self._state


def _predicted(motion: Motion, state: Sequence[float], last: Control, spread: _Matrix) -> tuple[list[float], _Matrix]:
    """Return the state and its covariance one tick later, for the middle of the vehicle."""
    x, y, yaw, v = state
    slip, turn, after = motion(v, last)
    c, s = (mkz.TICK_S * part for part in scalars.cos_sin(yaw + slip))
    moved = [x + v * c, y + v * s, yaw + v * turn, after]
    # columns of the Jacobian beyond the identity: x, y by yaw; x, y, yaw by speed
    rows = (
        (0.0, 0.0, -v * s, c),
        (0.0, 0.0, v * c, s),
        (0.0, 0.0, 0.0, turn),
        (0.0, 0.0, 0.0, 0.0),
    )
    half = [[spread[i][j] + sum(rows[i][k] * spread[k][j] for k in (2, 3)) for j in range(4)] for i in range(4)]
    grown = [[half[i][j] + sum(half[i][k] * rows[j][k] for k in (2, 3)) for j in range(4)] for i in range(4)]
    for k in range(4):
        grown[k][k] += _DRIFT[k]
    return moved, grown


def _corrected(state: list[float], spread: _Matrix, k: int, away: float) -> tuple[list[float], _Matrix]:
    """Return state and covariance corrected by one measured number, `away` from its prediction.

    One number at a time is enough, because measurement noises are independent.
    """
    row = spread[k]
    total = row[k] + _MEASURED[k]
    gain = [spread[i][k] / total for i in range(4)]
    corrected = [state[i] + gain[i] * away for i in range(4)]
    return corrected, [[spread[i][j] - gain[i] * row[j] for j in range(4)] for i in range(4)]
