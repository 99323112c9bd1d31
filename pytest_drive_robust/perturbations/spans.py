"""Which ticks a perturbation touched, for perturbations that work in every tick."""

from __future__ import annotations

from collections.abc import Iterable

from pytest_drive_robust.domain.result import Injection

__all__ = ["Spans"]


class Spans:
    """First and last touched tick of each signal, in the order in which the signals came up."""

    __slots__ = ("_first", "_last")

    def __init__(self) -> None:
        self._first: dict[str, int] = {}
        self._last = 0

    def touch(self, tick: int, signals: Iterable[str]) -> None:
        """`signals` were perturbed in `tick`."""
        for signal in signals:
            self._first.setdefault(signal, tick)
        self._last = tick

    def injections(self, perturbation: str) -> tuple[Injection, ...]:
        """One stretch for each signal: from its first tick to the last tick of the episode."""
        return tuple(Injection(perturbation, signal, first, self._last) for signal, first in self._first.items())
