"""The arithmetic of the gate: closed forms, no resampling, the same numbers in every process.

`gate(clean, perturbed, threshold, margin, alpha)` is all of it on two lists of scores. Its parts: `rules` turns a
requirement into linear forms, `judges` reads them (`evidence` is the default one), `order` says in which order routes
are read, `planning` what so many of them can show, `sequential_intervals` and `intervals` how sure a value is,
`several` what many verdicts mean together.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_drive_robust.stats.gate import GateVerdict, gate

__all__ = ["GateVerdict", "gate"]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(importlib.import_module(f"{__name__}.gate"), name)
    globals()[name] = value  # asked once
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    """Keeps `gate` the function: importing the module of that name would otherwise replace it here."""

    def __setattr__(self, name: str, value: object) -> None:
        if name not in __all__ or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
