"""Which drive stands in each row of the table, in each of the two readings of the failures.

The readings (`docs/explanation/readings.md`) differ under burst and latency, and latency as `released` has it is
compared with a clean drive of its own, which gets the same warm-up. Every other row is the same drive in both: driven
once, and shown in both.
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
"""The row that latency is compared with: `clean` in the reading `paper`, clean with the warm-up in `released`."""


@cache
def called_in(reading: str, row: str) -> str:
    """Return the setting, as a report calls it, that stands in a row of the table."""
    if row == NO_LATENCY:
        return clean_of(called_in(reading, FAMILIES["latency"][0]))
    return str(Setting.parse(row).read_as(DriveReading(reading, "benchmarks/paper.py")))


@cache
def clean_of(setting: str) -> str:
    """Return the clean drive that a setting, as a report calls it, is compared with; a clean drive is its own."""
    return str(Setting.parse(setting).baseline)


DRIVEN = tuple(dict.fromkeys(called_in(reading, row) for reading in READINGS for row in (CLEAN, NO_LATENCY, *SETTINGS)))
"""All settings of both readings as reports call them."""

SAME = tuple(row for row in SETTINGS if len({called_in(reading, row) for reading in READINGS}) == 1)
"""The rows that are the same drive in both readings."""


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
        """Return the clean scores that a row is compared with and its own, or None where one was not driven."""
        driven = self.results.agents.get(agent)
        setting = called_in(self.reading, row)
        if driven is None or setting not in driven.settings:
            return None
        return driven.settings[clean_of(setting)], driven.settings[setting]


def cells_of(results: Results) -> list[tuple[str, str, str]]:
    """Return reading, agent and row of each cell that was driven; one that both readings share counts once."""
    return [
        (reading, agent, row)
        for reading in READINGS
        for agent in results.agents
        for row in SETTINGS
        if (reading == READINGS[0] or row not in SAME) and Drives(results, reading).pair(agent, row) is not None
    ]
