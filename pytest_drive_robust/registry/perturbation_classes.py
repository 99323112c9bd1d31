"""Whether the class of somebody's perturbation can be used: a dataclass, with sentences that nobody else has."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import PerturbationError, PluginError
from pytest_drive_robust.perturbations.base import Perturbation, check_severities_are_fields
from pytest_drive_robust.perturbations.sentences import check_sentences

if TYPE_CHECKING:
    from pytest_drive_robust.registry.entries import Entry


def checked_class(cls: object, origin: str, name: str) -> type[Perturbation]:
    """Return the class that is registered under a name. Raises `PluginError` for one that cannot be used."""
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
        check_sentences(cls, BUILTIN.values())
    except PerturbationError as error:
        raise PluginError(f"the perturbation {name!r} from {origin} cannot be used: {error}") from None
    return cls


def check_told_apart(one: Entry, cls: type[Perturbation], other: Entry, other_cls: type[Perturbation]) -> None:
    """Raise `PluginError` for two failures of somebody with one sentence: their names would say which is driven."""
    try:
        check_sentences(cls, [other_cls])
    except PerturbationError as error:
        raise PluginError(
            f"the perturbations {one.name!r} from {one.origin} and {other.name!r} from {other.origin} cannot be used "
            f"together: {error} To replace one by the other, register it under the same name."
        ) from None


def _check_is_dataclass(cls: type[Perturbation]) -> None:
    """Raise `PerturbationError` for severities that are none, because nobody made a dataclass of their class."""
    if "__dataclass_params__" in vars(cls):
        return
    shown = re.findall(r"{(\w+)", cls.phrase)
    for name, annotation in vars(cls).get("__annotations__", {}).items():
        is_of_class = "ClassVar" in str(annotation) or name.startswith("_") or hasattr(Perturbation, name)
        if name in shown or (name in vars(cls) and not is_of_class):
            told = f"{cls.__name__} has {name!r}, but is no dataclass, so that it is no severity"
            raise PerturbationError(f"{told}: write @dataclass above the class.")
