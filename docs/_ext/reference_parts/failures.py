"""The failures: their chapters in the gallery, and their table."""

from __future__ import annotations

import re
from collections.abc import Iterator

from pytest_drive_robust.perturbations import BUILTIN
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.ladder import Ladder, ladder_of
from reference_parts.rst import heading, list_table

_TICK_S = 0.05


def failures() -> str:
    """Return the gallery's chapter of each failure: pictures, docstring, severities, readings."""
    return "\n".join(line for name, cls in BUILTIN.items() for line in _failure(name, cls))


def failure_table() -> str:
    """Return the built-in failures with their sentences."""
    rows = [
        (f":ref:`{_plain(cls)} <failure-{name}>`", f"``{cls.phrase}``", f"``{cls.__name__}``", _levels(cls))
        for name, cls in BUILTIN.items()
    ]
    return list_table(("failure", "sentence", "class", "severity, mild to severe"), rows)


def _failure(name: str, cls: type[Perturbation]) -> Iterator[str]:
    yield from [f".. _failure-{name}:", "", *heading(_plain(cls), "-"), ""]
    yield from [f".. image:: /pictures/failures/{name}.webp", f"   :alt: {_plain(cls)}: clean and perturbed", ""]
    yield from [f"Sentence: ``{cls.phrase}``. Ladder, mild to severe: {_levels(cls)}.", ""]
    readings = "; ".join(
        f"``{reading}``: {', '.join(f'``{key}={value}``' for key, value in switches.items())}"
        for reading, switches in cls.readings.items()
    )
    if readings:
        yield from [f"Readings: {readings}.", ""]
    yield from [f".. autoclass:: {cls.__module__}.{cls.__name__}", "   :no-index:", ""]


def _plain(cls: type[Perturbation]) -> str:
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", cls.__name__)
    return words.capitalize().replace("Gps", "GPS")


def _levels(cls: type[Perturbation]) -> str:
    ladder: Ladder = ladder_of(cls, dt_s=_TICK_S)
    labels = [ladder.label(level) for level in ladder.levels]
    return f"{', '.join(labels)}" if len(labels) <= 12 else f"{labels[0]}, {labels[1]}, ... {labels[-1]}"
