"""What environments write on highway-env's classes stays inside the environment that wrote it.

`IntersectionEnv` sets `IDMVehicle.DISTANCE_WANTED`, `COMFORT_ACC_MAX` and `COMFORT_ACC_MIN` on the class and never puts
them back: every later environment of the process would drive other trajectories for the same seed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

import highway_env.vehicle.behavior  # noqa: F401 -- its classes must exist before they can be watched
import highway_env.vehicle.controller
import highway_env.vehicle.dynamics  # noqa: F401
from highway_env.vehicle.objects import RoadObject

from pytest_drive_robust.errors import SimulationError

__all__ = ["ClassAttributes", "class_attributes", "differences"]

Values = Mapping[tuple[type, str], object]
ABSENT = object()
"""The value of an attribute that a class does not define itself."""


class ClassAttributes:
    """One environment's own values of class attributes, in force only while its code runs.

    >>> from highway_env.vehicle.behavior import IDMVehicle
    >>> own, before = ClassAttributes(), IDMVehicle.DISTANCE_WANTED
    >>> with own.inside():
    ...     IDMVehicle.DISTANCE_WANTED = 7
    >>> IDMVehicle.DISTANCE_WANTED == before, own.leaks
    (True, ('IDMVehicle.DISTANCE_WANTED',))
    """

    def __init__(self) -> None:
        self._own: Values = MappingProxyType({})
        self._outside = class_attributes()

    @property
    def leaks(self) -> tuple[str, ...]:
        """What the environment wrote so far, sorted: `("IDMVehicle.DISTANCE_WANTED", ...)`."""
        return tuple(sorted(f"{cls.__name__}.{name}" for cls, name in self._own))

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Run the environment's code with its own values; everybody else's come back afterwards, also on an error."""
        outside = class_attributes()
        _write(self._own)
        try:
            yield
        finally:
            self._own = MappingProxyType(differences(outside, class_attributes()))
            _write({key: outside.get(key, ABSENT) for key in self._own})

    def begin(self) -> None:
        """A new episode: forget what the last one wrote, and remember what everybody has now."""
        self._own = MappingProxyType({})
        self._outside = class_attributes()

    def check(self) -> None:
        """Raise `SimulationError` when the classes are not as they were at `begin`: numbers of this process are mixed.

        What `inside` saw is put back, so this happens only when other code changed the classes meanwhile.
        """
        changed = differences(self._outside, class_attributes())
        if changed:
            names = ", ".join(sorted(f"{cls.__name__}.{name}" for cls, name in changed))
            raise SimulationError(
                f"class attributes of highway-env changed while an episode ran, by other code than its environment: "
                f"{names}. Set them before the episode, or on the vehicles themselves."
            )


def class_attributes() -> dict[tuple[type, str], object]:
    """Every plain value that a class of highway-env's road objects holds: no methods, properties or dunders."""
    return {
        (cls, name): value
        for cls in _family(RoadObject)
        for name, value in vars(cls).items()
        if not name.startswith("__") and not callable(value) and not hasattr(value, "__get__")
    }


def differences(before: Values, after: Values) -> dict[tuple[type, str], object]:
    """The attributes whose value is another one afterwards, with that value; `ABSENT` for one that is gone."""
    changed = {key: value for key, value in after.items() if before.get(key, ABSENT) is not value}
    return changed | {key: ABSENT for key in before if key not in after}


def _write(values: Values) -> None:
    for (cls, name), value in values.items():
        if value is not ABSENT:
            setattr(cls, name, value)
        elif name in vars(cls):
            delattr(cls, name)


def _family(cls: type) -> Iterator[type]:
    """The class and all that descend from it, each once, in the order of their making."""
    seen: dict[type, None] = {cls: None}
    for each in (waiting := [cls]):
        for child in each.__subclasses__():
            if child not in seen:
                seen[child] = None
                waiting.append(child)
    return iter(seen)
