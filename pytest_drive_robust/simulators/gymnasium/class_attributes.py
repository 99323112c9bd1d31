"""What environments write on highway-env's classes stays inside the environment that wrote it.

`IntersectionEnv` sets `IDMVehicle.DISTANCE_WANTED`, `COMFORT_ACC_MAX` and `COMFORT_ACC_MIN` on the class and never puts
them back: every later environment of the process would drive other trajectories for the same seed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import highway_env.vehicle.behavior
import highway_env.vehicle.dynamics  # noqa: F401 -- classes must exist before they can be watched
from highway_env.vehicle.objects import RoadObject

from pytest_drive_robust.errors import SimulationError

__all__ = ["ClassAttributes"]

Values = Mapping[type, Mapping[str, object]]
_ABSENT = object()
"""The value of an attribute that a class does not define itself."""


class ClassAttributes:
    """One environment's own values of class attributes, in force only while its code runs.

    >>> from highway_env.vehicle.behavior import IDMVehicle
    >>> own, before = ClassAttributes(), IDMVehicle.DISTANCE_WANTED
    >>> with own.inside():
    ...     IDMVehicle.DISTANCE_WANTED = 7
    >>> IDMVehicle.DISTANCE_WANTED == before, own.written
    (True, ('IDMVehicle.DISTANCE_WANTED',))
    """

    def __init__(self) -> None:
        self._own: Values = {}
        self._outside = _snapshot()

    @property
    def written(self) -> tuple[str, ...]:
        """What the environment wrote so far, sorted: `("IDMVehicle.DISTANCE_WANTED", ...)`."""
        return _names(self._own)

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Run the environment's code with its own values; everybody else's come back afterwards, also on an error."""
        outside = _snapshot()
        _write(self._own)
        try:
            yield
        finally:
            self._own = _changes(outside, _snapshot())
            _write({cls: {name: outside[cls].get(name, _ABSENT) for name in own} for cls, own in self._own.items()})

    def begin(self) -> None:
        """Begin a new episode: forget what the last one wrote, and remember what everybody has now."""
        self._own = {}
        self._outside = _snapshot()

    def check(self) -> None:
        """Raise `SimulationError` when the classes are not as they were at `begin`.

        What environments write is put back by `inside`: this finds other code that changed them meanwhile, and whose
        episodes would depend on their order.
        """
        changed = _changes(self._outside, _snapshot())
        if changed:
            raise SimulationError(
                f"while an episode ran, other code than its environment changed {', '.join(_names(changed))} for all "
                "vehicles of this process. Change classes before the episode, or set the values on single vehicles."
            )


def _snapshot() -> Values:
    """Return what each class of highway-env's road objects defines itself."""
    return {cls: vars(cls).copy() for cls in _family()}


def _family() -> list[type]:
    """Return `RoadObject` and all that descend from it, each once."""
    family: list[type] = [RoadObject]
    for cls in family:  # grows while it is read
        children: list[type] = cls.__subclasses__()
        family.extend(child for child in children if child not in family)
    return family


def _changes(before: Values, after: Values) -> dict[type, dict[str, object]]:
    """Return the plain attributes that are others afterwards, by class. Classes that are new have always been so."""
    changes: dict[type, dict[str, object]] = {}
    for cls, values in after.items():
        earlier = before.get(cls, values)
        for name, value in values.items():
            if earlier.get(name, _ABSENT) is not value and _is_plain(name, value):
                changes.setdefault(cls, {})[name] = value
        if len(earlier) > len(values) or cls in changes:
            for name, value in earlier.items():
                if name not in values and _is_plain(name, value):
                    changes.setdefault(cls, {})[name] = _ABSENT
    return changes


def _is_plain(name: str, value: object) -> bool:
    """Return whether a value is a number, text or list: no method, property or dunder."""
    return not name.startswith("__") and not callable(value) and not hasattr(value, "__get__")


def _write(values: Values) -> None:
    for cls, attributes in values.items():
        for name, value in attributes.items():
            if value is not _ABSENT:
                setattr(cls, name, value)
            elif name in vars(cls):
                delattr(cls, name)


def _names(values: Values) -> tuple[str, ...]:
    return tuple(sorted(f"{cls.__name__}.{name}" for cls, attributes in values.items() for name in attributes))
