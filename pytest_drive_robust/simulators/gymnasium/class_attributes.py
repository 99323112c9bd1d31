"""Isolate what environments write to classes of highway-env, which all environments of a process share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import highway_env.vehicle.behavior
import highway_env.vehicle.dynamics  # noqa: F401 -- classes must exist before they can be watched
from highway_env.vehicle.objects import RoadObject

_Values = Mapping[type, Mapping[str, object]]


class ClassAttributes:
    """One environment's own values of class attributes in one episode, in force only while its code runs.

    `IntersectionEnv` sets `IDMVehicle.DISTANCE_WANTED`, `COMFORT_ACC_MAX` and `COMFORT_ACC_MIN` on the class and never
    puts them back: every later environment of the process would drive other trajectories for the same seed.

    >>> from highway_env.vehicle.behavior import IDMVehicle
    >>> own, before = ClassAttributes(), IDMVehicle.DISTANCE_WANTED
    >>> with own.inside():
    ...     IDMVehicle.DISTANCE_WANTED = 7
    >>> IDMVehicle.DISTANCE_WANTED == before
    True
    """

    def __init__(self) -> None:
        self._own: _Values = {}

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Run the environment's code with its own values; restore the outer values afterwards, also on an error."""
        outside = _snapshot()
        _write(self._own)
        try:
            yield
        finally:
            self._own = _snapshot()
            _write(outside)


def _snapshot() -> _Values:
    """Return by class the plain attributes that `RoadObject` and each of its subclasses define."""
    family: list[type] = [RoadObject]
    for cls in family:  # the list grows during the loop
        children: list[type] = cls.__subclasses__()
        family.extend(child for child in children if child not in family)
    return {cls: _plain(cls) for cls in family}


def _plain(cls: type) -> dict[str, object]:
    """Return the plain values of a class: numbers, texts, lists, but no method, property or dunder."""
    values = vars(cls).items()
    return {k: v for k, v in values if not (k.startswith("__") or callable(v) or hasattr(v, "__get__"))}


def _write(values: _Values) -> None:
    for cls, attributes in values.items():
        for name in _plain(cls).keys() - attributes.keys():
            delattr(cls, name)
        for name, value in attributes.items():
            if vars(cls).get(name, values) is not value:
                setattr(cls, name, value)
