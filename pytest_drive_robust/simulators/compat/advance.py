"""One tick: everybody decides, everybody moves, everybody collides, in highway-env's order."""

from __future__ import annotations

import numba

from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.bicycle import face, move
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.contact import collide
from pytest_drive_robust.simulators.compat.drivers import act, tell
from pytest_drive_robust.simulators.compat.lanes import coordinates

__all__ = ["advance", "settle"]

_jit = numba.njit(cache=True)


@_jit
def advance(arrays: Arrays, dt_s: float, ego: int, told: int, acceleration: float, steering: float) -> None:
    """`ego.act(action)` (unless told nothing), `Road.act()`, `Road.step(dt_s)`."""
    if told != c.TOLD_NOTHING:
        tell(arrays, ego, told, acceleration, steering)
    count = arrays.vehicle_count
    for body in range(count):
        act(arrays, body)
    for body in range(count):
        move(arrays, body, dt_s)
    for body in range(count):
        for other in range(body + 1, arrays.bodies.shape[0]):
            collide(arrays, body, other, dt_s)


@_jit
def settle(arrays: Arrays) -> None:
    """Fill what depends on the poses of the bodies after they were read: directions and lane coordinates."""
    for body in range(arrays.bodies.shape[0]):
        face(arrays, body)
        for lane in range(arrays.lanes.shape[0]):
            s, lateral = coordinates(arrays, lane, arrays.bodies[body, c.B_X], arrays.bodies[body, c.B_Y])
            arrays.along[lane, body], arrays.across[lane, body] = s, lateral
