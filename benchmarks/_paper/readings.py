"""The drive of each row of the table, in each of the two readings of the failures.

The readings (`docs/explanation/readings.md`) differ under burst and latency. Latency in the reading `released` is
compared with its own clean drive, which has an equal warm-up. Every other row is driven once and shown in both
readings.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from _paper.published import CLEAN, FAMILIES, SETTINGS
from _paper.results import Results, Scores
from pytest_drive_robust import Setting
from pytest_drive_robust.perturbations.readings import READINGS, DriveReading

__all__ = ["DRIVEN", "NO_LATENCY", "READINGS", "SAME", "Drives", "called_in", "cells_of", "clean_of"]

NO_LATENCY = "0 ms latency"
"""The clean row of latency: `clean` in the reading `paper`, clean with the warm-up in `released`."""


@cache
def called_in(reading: str, row: str) -> str:
    """Return the setting of a row of the table in a reading, by its name in reports."""
    if row == NO_LATENCY:
        return clean_of(called_in(reading, FAMILIES["latency"][0]))
    return str(Setting.parse(row).read_as(DriveReading(reading, "benchmarks/paper.py")))


@cache
def clean_of(setting: str) -> str:
    """Return the clean setting of a setting, both by name in reports; a clean setting is its own."""
    return str(Setting.parse(setting).baseline)


DRIVEN = tuple(dict.fromkeys(called_in(reading, row) for reading in READINGS for row in (CLEAN, NO_LATENCY, *SETTINGS)))
"""All settings of both readings, by name in reports."""

SAME = tuple(row for row in SETTINGS if len({called_in(reading, row) for reading in READINGS}) == 1)
"""The rows that both readings share."""


@dataclass(frozen=True, slots=True)
class Drives:
    """The results in one reading."""

    results: Results
    reading: str

    def scores(self, agent: str, row: str) -> Scores | None:
        """Return the scores of an agent in a row, or None where that was not driven."""
        driven = self.results.agents.get(agent)
        return None if driven is None else driven.settings.get(called_in(self.reading, row))

    def pair(self, agent: str, row: str) -> tuple[Scores, Scores] | None:
        """Return (clean scores of the row, scores of the row), or None when either was not driven."""
        driven = self.results.agents.get(agent)
        setting = called_in(self.reading, row)
        if driven is None or setting not in driven.settings:
            return None
        return driven.settings[clean_of(setting)], driven.settings[setting]


def cells_of(results: Results) -> list[tuple[str, str, str]]:
    """Return (reading, agent, row) of each driven cell; a cell that both readings share is listed once."""
    return [
        (reading, agent, row)
        for reading in READINGS
        for agent in results.agents
        for row in SETTINGS
        if (reading == READINGS[0] or row not in SAME) and Drives(results, reading).pair(agent, row) is not None
    ]
