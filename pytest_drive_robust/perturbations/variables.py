"""Typed reading of environment variables: what cannot be read is named with its value."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TypeVar

from pytest_drive_robust.errors import PerturbationError, UsageError, nearest
from pytest_drive_robust.perturbations.base import Perturbation

__all__ = ["Variables"]

_Made = TypeVar("_Made", bound=Perturbation)
_SWITCH = {"1": True, "true": True, "yes": True, "on": True, "0": False, "false": False, "no": False, "off": False}


class Variables:
    """A view of an environment. An empty or blank variable counts as not set. Every method raises `UsageError`."""

    __slots__ = ("_environ",)

    def __init__(self, environ: Mapping[str, str]) -> None:
        self._environ = environ

    def text(self, name: str) -> str:
        """The value without blanks around it, `""` when not set."""
        return self._environ.get(name, "").strip()

    def switch(self, name: str, *, default: bool = False) -> bool:
        """1/0, true/false, yes/no, on/off in any case."""
        text = self.text(name).lower()
        if text and text not in _SWITCH:
            raise self._refused(name, f"one of {', '.join(_SWITCH)}")
        return _SWITCH.get(text, default)

    def number(self, name: str, default: float, *, above: float = -math.inf) -> float:
        """A finite number above `above`."""
        text = self.text(name)
        if not text:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value > above):
            raise self._refused(name, "a number" + (f" above {above:g}" if math.isfinite(above) else ""))
        return value

    def whole(self, name: str, default: int, *, low: int | None = 0) -> int:
        """A whole number of at least `low`."""
        text = self.text(name)
        if not text:
            return default
        if not text.lstrip("+-").isdecimal() or (low is not None and int(text) < low):
            raise self._refused(name, "a whole number" + (f" of at least {low}" if low is not None else ""))
        return int(text)

    def choice(self, name: str, default: str, choices: Sequence[str]) -> str:
        """One of `choices`, in any case."""
        text = self.text(name).lower() or default
        if text not in choices:
            close = nearest(text, choices)
            advice = "" if close is None else f". Did you mean {close!r}?"
            raise self._refused(name, f"one of {', '.join(choices)}{advice}")
        return text

    def made(self, cls: type[_Made], names: Sequence[str], severities: Mapping[str, object]) -> _Made:
        """`cls(**severities)`; when it refuses them, the error names those variables of `names` that are set."""
        try:
            return cls(**severities)
        except PerturbationError as error:
            given = ", ".join(f"{name}={self._environ[name]!r}" for name in names if self.text(name))
            raise UsageError(f"{given}: {error}") from error

    def _refused(self, name: str, expected: str) -> UsageError:
        return UsageError(f"the environment variable {name} is {self._environ[name]!r}, expected {expected}")
