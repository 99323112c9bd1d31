"""Allowances: how much a metric may get worse, such as `ds:-5%`, `sr:-0.05`, `rd:+0.05`."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from pytest_drive_robust.errors import UnknownNameError, UsageError

_TOPS = {"DS": 100.0, "SR": 1.0, "RD": 1.0}
_EXPECTED = "expected a drop of DS or SR (ds:-5%, ds:-3, sr:-0.05) or a rise of RD (rd:+0.05)"


@dataclass(frozen=True, slots=True)
class Allowance:
    """One metric may get worse by `amount` and no more.

    DS and SR may drop, by a share of the old value (`relative`) or in their own unit; RD may rise, in its own unit.
    `str()` returns the text that `parse_allowances` reads.
    """

    metric: str
    amount: float
    relative: bool = False

    def __str__(self) -> str:
        sign = "+" if self.metric == "RD" else "-"
        amount = f"{100.0 * self.amount:g}%" if self.relative else f"{self.amount:g}"
        return f"{self.metric.lower()}:{sign}{amount}"

    @property
    def top(self) -> float:
        """The best value of the metric."""
        return _TOPS[self.metric]

    @property
    def sentence(self) -> str:
        """The allowance as a sentence, such as `"DS drops by 5 % at most"`."""
        verb = "rises" if self.metric == "RD" else "drops"
        amount = f"{100.0 * self.amount:g} %" if self.relative else f"{self.amount:g}"
        return f"{self.metric} {verb} by {amount} at most"


DEFAULT_ALLOWANCES = (Allowance("DS", 0.05, relative=True),)
"""A drop of DS by 5 %: an unchanged agent fails it in at most 0.2 % of its settings. With 0 it would be 4 %."""


def parse_allowances(given: Iterable[str], *, source: str) -> tuple[Allowance, ...]:
    """Return the allowances of all texts, each with commas between allowances; `DEFAULT_ALLOWANCES` without a text.

    Raises `UsageError`, naming `source`, for text that is no allowance or holds none.
    """
    found: dict[Allowance, None] = {}
    for each in given:
        texts = [text.strip() for text in each.split(",") if text.strip()]
        if not texts:
            raise UsageError(f"{source} is {each!r}, which is empty; {_EXPECTED}.")
        found |= dict.fromkeys(_parse(text, source) for text in texts)
    return tuple(found) or DEFAULT_ALLOWANCES


def _parse(text: str, source: str) -> Allowance:
    name, colon, rest = (part.strip() for part in text.partition(":"))
    metric = name.upper()
    if colon and metric not in _TOPS:
        raise UnknownNameError.of(f"metric for {source}", name, map(str.lower, _TOPS))
    found = re.fullmatch(r"([+-])(\d+(?:\.\d*)?|\.\d+)\s*(%?)", rest)
    if not found:
        raise UsageError(f"{source} is {text!r}, {_EXPECTED}.")
    sign, number, percent = found.groups()
    if sign != ("+" if metric == "RD" else "-"):
        better = "RD gets worse by rising" if metric == "RD" else f"{metric} gets worse by dropping"
        raise UsageError(f"{source} is {text!r}, but {better}; {_EXPECTED}.")
    if metric == "RD" and percent:
        raise UsageError(f"{source} is {text!r}, but RD is a share already; write rd:+{float(number) / 100.0:g}.")
    amount = float(number) / (100.0 if percent else 1.0)
    if not (math.isfinite(amount) and amount < (1.0 if percent else _TOPS[metric])):
        raise UsageError(f"{source} is {text!r}, which allows everything; {_EXPECTED}.")
    return Allowance(metric, amount, relative=bool(percent))
