"""The severities that a search or a strategy steps through, from mild to severe.

A class declares its steps in the attribute `ladder` (see `Perturbation`). Latency and delay step by whole ticks,
because a simulation has nothing between two ticks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.perturbations.sentence_forms import templates_of
from pytest_drive_robust.perturbations.sentences import brackets
from pytest_drive_robust.perturbations.severity import whole_ticks
from pytest_drive_robust.perturbations.severity_text import render_value
from pytest_drive_robust.perturbations.severity_types import retyped

_LONGEST_DELAY_S = 1.0
_ROUNDING = 1e-9  # a second by the length of a tick may come out a hair below a whole number


@dataclass(frozen=True)
class Ladder:
    """`levels` of the severity `field`, mildest first; the other severities are those of `template`.

    `tick_ms` is the length of a tick in milliseconds where levels are whole ticks, else None. `reading` is applied to
    the template and to perturbations that are compared with the template.
    """

    template: Perturbation
    field: str
    levels: tuple[float, ...]
    tick_ms: float | None = None
    reading: DriveReading | None = None

    def at(self, level: float) -> Perturbation:
        """Return the perturbation with the severity `level`. Raises `PerturbationError` for an impossible severity."""
        return self.template.with_severities(**{self.field: level})

    def level_of(self, perturbation: Perturbation) -> float:
        """Return a perturbation's severity on this ladder. Raises `PerturbationError` if another severity differs."""
        if type(perturbation) is type(self.template):
            perturbation = perturbation if self.reading is None else perturbation.read_as(self.reading)
            level = perturbation.parameters()[self.field]
            if isinstance(level, (int, float)) and self.at(level).parameters() == perturbation.parameters():
                return float(level)
        raise PerturbationError(
            f"'{perturbation}' is not on the ladder of {type(self.template).__name__}.{self.field}, expected a "
            f"severity like '{self.template}' with another {self.field}."
        )

    def severity(self, level: float) -> float:
        """Return a number that grows with severity; levels with the same effect have the same number."""
        if self.tick_ms is not None:
            return whole_ticks(level, self.tick_ms)
        return level if self.levels[-1] >= self.levels[0] else -level

    def label(self, level: float) -> str:
        """Return the level as text with its unit: `"140 ms"`, `"0.5"`."""
        return f"{render_value(round(float(level), 9))} {self.unit}".rstrip()

    @property
    def unit(self) -> str:
        """The unit at the end of the severity's name: `"ms"`, `"s"`, `"m"` or nothing."""
        ending = self.field.rpartition("_")[2]
        return ending if ending in ("ms", "s", "m") else ""

    @property
    def word(self) -> str:
        """The words of the failure's phrase: `"latency"`, `"GPS noise"`."""
        return failure_word(type(self.template))

    @property
    def name(self) -> str:
        """The word, and in brackets the failure's unusual fields: `"latency (reading=released)"`."""
        unusual = brackets(self.template, without=self.field)
        return f"{self.word} ({unusual})" if unusual else self.word


def failure_word(cls: type[Perturbation]) -> str:
    """Return the phrase of a class, else its name in words, without its severities and their units.

    >>> from pytest_drive_robust.perturbations import FrameBlend, GpsNoise, InferenceLatency
    >>> failure_word(InferenceLatency), failure_word(GpsNoise), failure_word(FrameBlend)
    ('latency', 'GPS noise', 'frame blend')
    """
    words = re.sub(r"\{\w+\}(?:\s+(?:ms|m|s)\b)?", " ", templates_of(cls)[-1].text)
    return " ".join(words.split())


def ladder_of(
    perturbation: Perturbation | type[Perturbation],
    *,
    dt_s: float,
    levels: Iterable[float] | None = None,
    reading: DriveReading | None = None,
) -> Ladder:
    """Return the ladder of a class with its default severities, or of an object, whose other severities are kept.

    `dt_s` is the length of a tick in seconds. `levels` replaces the usual levels, mildest first. `reading` is applied
    to the failure, if there is one.
    Raises `PerturbationError` for a class without a ladder, and for levels that go up and down or are no severities.

    >>> from pytest_drive_robust.perturbations import InferenceLatency, SpeedNoise
    >>> ladder_of(InferenceLatency, dt_s=0.02).levels[:3], ladder_of(SpeedNoise, dt_s=0.02).levels[:2]
    ((20.0, 40.0, 60.0), (0.9, 0.8))
    """
    cls = perturbation if isinstance(perturbation, type) else type(perturbation)
    if not issubclass(cls, Perturbation):
        raise PerturbationError(f"{perturbation!r} has no severity to step through: expected one Perturbation.")
    field, usual = _declared(cls, dt_s)
    try:
        steps = tuple(float(level) for level in (usual if levels is None else levels))
    except (TypeError, ValueError):
        raise PerturbationError(
            f"the levels of {cls.__name__} are {levels!r}, expected a list of numbers, from mild to severe."
        ) from None
    if not _one_way(steps):
        raise PerturbationError(
            f"the levels of {cls.__name__} are {steps}, expected at least one, from mild to severe."
        )
    changed: dict[str, Any] = {field: steps[0]}
    usual_others = {**cls.example, **changed}
    usual_others |= retyped(cls, usual_others)
    template = cls(**usual_others) if isinstance(perturbation, type) else perturbation.with_severities(**changed)
    tick_ms = 1000.0 * dt_s if cls.ladder is not None and cls.ladder[1] == "ticks" else None
    template = template if reading is None else template.read_as(reading)
    ladder = Ladder(template, field, tuple(dict.fromkeys(steps)), tick_ms, reading)
    for level in ladder.levels:
        ladder.at(level)  # refuse an impossible level now, not after an hour of driving
    return ladder


def _declared(cls: type[Perturbation], dt_s: float) -> tuple[str, tuple[float, ...]]:
    if cls.ladder is not None:
        field, steps = cls.ladder
        known = [item.name for item in fields(cls)]
        if field not in known:
            expected = ", ".join(known) or "a field, of which it has none"
            raise PerturbationError(f"the ladder of {cls.__name__} names {field!r}, expected {expected}.")
        return field, _ticks(dt_s) if steps == "ticks" else tuple(steps)
    first = next((field.name for field in fields(cls)), "severity")
    raise PerturbationError(
        f"{cls.__name__} has no ladder of severities. Give it one: "
        f"ladder: ClassVar = ('{first}', (mildest, ..., most severe))."
    )


def _one_way(levels: tuple[float, ...]) -> bool:
    pairs = list(pairwise(levels))
    finite = bool(levels) and all(map(math.isfinite, levels))
    return finite and (all(a < b for a, b in pairs) or all(a > b for a, b in pairs))


def _ticks(dt_s: float) -> tuple[float, ...]:
    """Return whole ticks in milliseconds, up to a second, at least one."""
    most = max(1, math.floor(_LONGEST_DELAY_S / dt_s + _ROUNDING))
    return tuple(round(1000.0 * dt_s * count, 6) for count in range(1, most + 1))
