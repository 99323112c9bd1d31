"""One tick: everybody decides, everybody moves, everybody collides, in highway-env's order."""

from __future__ import annotations

from collections.abc import Callable

from pytest_drive_robust.simulators.compat.bicycle import face, move
from pytest_drive_robust.simulators.compat.columns import Arrays
from pytest_drive_robust.simulators.compat.compiled import kernel, sources_digest
from pytest_drive_robust.simulators.compat.contact import collide
from pytest_drive_robust.simulators.compat.drivers import act
from pytest_drive_robust.simulators.compat.lanes import locate

__all__ = ["advance", "settle"]


def _advance(sources: int) -> Callable[[Arrays, int, float], None]:
    @kernel
    def advance(arrays: Arrays, vehicles: int, dt_s: float) -> None:
        _ = sources  # part of the cache's key
        for body in range(vehicles):
            act(arrays, body)
        for body in range(vehicles):
            move(arrays, body, dt_s)
        for body in range(vehicles):
            for other in range(body + 1, arrays.bodies.shape[0]):
                collide(arrays, body, other, dt_s)

    return advance


def _settle(sources: int) -> Callable[[Arrays], None]:
    @kernel
    def settle(arrays: Arrays) -> None:
        _ = sources
        for body in range(arrays.bodies.shape[0]):
            face(arrays, body)
            locate(arrays, body)

    return settle


advance = _advance(sources_digest())
"""`Road.act()` and `Road.step(dt_s)`; the first `vehicles` bodies are vehicles."""

settle = _settle(sources_digest())
"""Fills what depends on the poses of the bodies after they were read: directions and lane coordinates."""
