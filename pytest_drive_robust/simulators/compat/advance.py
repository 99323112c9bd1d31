"""One tick: everybody decides, everybody moves, everybody collides, in highway-env's order."""

from __future__ import annotations

from pytest_drive_robust.simulators.compat.bicycle import face, move
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.compiled import kernel
from pytest_drive_robust.simulators.compat.contact import collide
from pytest_drive_robust.simulators.compat.drivers import act
from pytest_drive_robust.simulators.compat.lanes import locate

__all__ = ["advance", "settle"]


@kernel
def advance(arrays: Arrays, vehicles: int, dt_s: float) -> None:
    """`Road.act()` and `Road.step(dt_s)`; the first `vehicles` bodies are vehicles."""
    for body in range(vehicles):
        act(arrays, body)
    for body in range(vehicles):
        move(arrays, body, dt_s)
    for body in range(vehicles):
        for other in range(body + 1, arrays.bodies.shape[0]):
            collide(arrays, body, other, dt_s)


@kernel
def settle(arrays: Arrays) -> None:
    """Fill what depends on the poses of the bodies after they were read: directions and lane coordinates."""
    for body in range(arrays.bodies.shape[0]):
        face(arrays, body)
        locate(arrays, body)
