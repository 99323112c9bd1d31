"""The cells of the table that differ from the paper's, and the ablations that tried what decides them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

from _paper.estimates import degradation
from _paper.published import PUBLISHED, SETTINGS
from _paper.readings import Drives
from pytest_drive_robust import Setting

__all__ = ["LEAST", "Difference", "differences", "pages_on"]

_ABLATIONS = Path(__file__).parents[1] / "ablations"
"""The folder of the pages that `benchmarks/ablations.py` writes."""

LEAST = 0.1
"""Least difference of RD of a cell that differs."""


class Difference(NamedTuple):
    """A cell whose RD, `here`, differs from that of the paper."""

    agent: str
    row: str
    here: float
    paper: float

    @property
    def off_by(self) -> float:
        """The difference in the digits that are shown."""
        return round(abs(round(self.here, 2) - self.paper), 2)


def differences(drives: Drives) -> list[Difference]:
    """Return the driven cells that differ from the paper's by `LEAST` or more, the largest difference first."""
    cells = [
        Difference(agent, row, here.value, PUBLISHED[agent][row].rd)
        for agent in drives.results.agents
        for row in SETTINGS
        if (here := degradation(drives, agent, (row,))) is not None
    ]
    return sorted((cell for cell in cells if cell.off_by >= LEAST), key=lambda cell: -cell.off_by)


def pages_on(agent: str, row: str) -> list[str]:
    """Return the names, such as `black/tcp`, of the pages that change an agent under the failure of a row.

    The failure may have another severity there, or another reading.
    """
    kind = _kind(row)
    names = [(page.relative_to(_ABLATIONS).with_suffix(""), page) for page in _ABLATIONS.rglob(f"{agent}.md")]
    return sorted(name.as_posix() for name, page in names if kind in _kinds(page))


@cache
def _kinds(page: Path) -> set[tuple[type, ...]]:
    """Return the failures under which a page compares a change with its base: such rows end in an interval."""
    rows = re.findall(r"^\| ([^|]+) \|.* to \S+\) \|$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {_kind(setting) for setting in rows}


def _kind(setting: str) -> tuple[type, ...]:
    return tuple(type(failure) for failure in Setting.parse(setting).perturbations)
