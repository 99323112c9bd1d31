"""Checks the class of a user's perturbation: a dataclass whose sentences no other perturbation has."""

from __future__ import annotations

import dataclasses
import re
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.errors import PerturbationError, PluginError, did_you_mean
from pytest_drive_robust.perturbations.base import Perturbation, check_severities_are_fields
from pytest_drive_robust.perturbations.sentence_checks import check_sentences

if TYPE_CHECKING:
    from pytest_drive_robust.registry.entries import Entry


def checked_class(cls: object, origin: str, name: str) -> type[Perturbation]:
    """Return `cls`, which is registered as `name`. Raises `PluginError` for a class that cannot be used."""
    if not (isinstance(cls, type) and issubclass(cls, Perturbation)):
        brackets = ", without brackets" if isinstance(cls, Perturbation) else ""
        raise PluginError(
            f"{cls!r} from {origin} is not a perturbation: expected a subclass of Perturbation{brackets}."
        )
    from pytest_drive_robust.perturbations import BUILTIN

    if cls in BUILTIN.values():
        return cls
    try:
        _check_is_dataclass(cls)
        check_severities_are_fields(cls)
        _check_said_fields(cls)
        check_sentences(cls, BUILTIN.values())
        _check_ladder(cls)
    except PerturbationError as error:
        raise PluginError(f"the perturbation {name!r} from {origin} cannot be used: {error}") from None
    except (AttributeError, OSError, TypeError, ValueError) as error:  # an attribute of the class has a wrong type
        told = f"{type(error).__name__}: {error}"
        raise PluginError(f"the perturbation {name!r} from {origin} cannot be used: {told}.") from error
    return cls


def check_told_apart(one: Entry, cls: type[Perturbation], other: Entry, other_cls: type[Perturbation]) -> None:
    """Raise `PluginError` when two users' perturbations share a sentence: only their names would tell them apart."""
    try:
        check_sentences(cls, [other_cls])
    except PerturbationError as error:
        raise PluginError(
            f"the perturbations {one.name!r} from {one.origin} and {other.name!r} from {other.origin} cannot be used "
            f"together: {error} To replace one by the other, register it under the same name."
        ) from None


def _check_is_dataclass(cls: type[Perturbation]) -> None:
    """Raise `PerturbationError` when `cls` has attributes meant as severities, but is no dataclass."""
    if "__dataclass_params__" in vars(cls):
        return
    shown = re.findall(r"{(\w+)", cls.phrase)
    for name, annotation in vars(cls).get("__annotations__", {}).items():
        is_of_class = "ClassVar" in str(annotation) or name.startswith("_") or hasattr(Perturbation, name)
        if name in shown or (name in vars(cls) and not is_of_class):
            told = f"{cls.__name__} has {name!r}, which is no severity, because the class is no dataclass"
            raise PerturbationError(f"{told}: write @dataclass above the class.")


def _check_said_fields(cls: type[Perturbation]) -> None:
    """Raise `PerturbationError` when `example`, `variants` or `readings` name a severity that the class lacks."""
    known = [field.name for field in dataclasses.fields(cls) if field.init]
    said = {"example": [cls.example], "variants": cls.variants.values(), "readings": cls.readings.values()}
    for attribute, several in said.items():
        for name in (name for values in several for name in values if name not in known):
            expected = f"one of {', '.join(known)}" if known else "no name, because the class has no fields"
            told = f"{attribute!r} of {cls.__name__} names {name!r}, which is not a field of the class"
            raise PerturbationError(f"{told}.{did_you_mean(name, known)} Expected {expected}.")


def _check_ladder(cls: type[Perturbation]) -> None:
    """Raise `PerturbationError` for a ladder that no search could step through; only a search builds its values."""
    ladder: Any = cls.ladder
    if ladder is None:
        return
    known = [field.name for field in dataclasses.fields(cls) if field.init]
    try:
        name, steps = ladder
        is_ladder = name in known and (steps == "ticks" or bool([float(step) for step in steps]))
    except (TypeError, ValueError):
        is_ladder = False
    if not is_ladder:
        raise PerturbationError(
            f"the ladder of {cls.__name__} is {ladder!r}, expected one of its fields ({', '.join(known) or 'none'}) "
            "and its values from mild to severe, as in ('gain', (0.9, 0.5, 0.1))."
        )
