"""When a camera freezes: the burst schedule of one camera, known in advance for every tick."""

from __future__ import annotations

from bisect import bisect_right

from pytest_drive_robust.perturbations.draws import Draws

__all__ = ["BurstSchedule"]


class BurstSchedule:
    """The bursts of one camera as (first tick, last tick) pairs, a pure function of the draws.

    In every tick without a burst a new one starts with `probability`; the tick that starts it belongs to it, and
    while one runs no new one starts. Tick 0 never starts one, because no earlier image exists. The schedule is
    worked out tick by tick from tick 1, whatever ticks are asked for, so it does not depend on who looks when.

    A burst lasts `longest_ticks`, or 2..`longest_ticks` with equal chances when `uniform`.
    """

    __slots__ = ("_draws", "_firsts", "_lasts", "_longest_ticks", "_next", "_probability", "_sensor", "_uniform")

    def __init__(self, draws: Draws, sensor: str, *, probability: float, longest_ticks: int, uniform: bool) -> None:
        self._draws = draws
        self._sensor = sensor
        self._probability = probability
        self._longest_ticks = longest_ticks
        self._uniform = uniform
        self._firsts: list[int] = []
        self._lasts: list[int] = []
        self._next = 1  # the first tick that is not decided yet

    def is_frozen(self, tick: int) -> bool:
        """True when the camera repeats an old image in `tick`."""
        while self._next <= tick:
            self._decide()
        index = bisect_right(self._firsts, tick) - 1
        return index >= 0 and tick <= self._lasts[index]

    def until(self, tick: int) -> list[tuple[int, int]]:
        """The bursts that began at or before `tick`, the last one cut off there."""
        self.is_frozen(tick)
        pairs = zip(self._firsts, self._lasts, strict=True)
        return [(first, min(last, tick)) for first, last in pairs if first <= tick]

    def _decide(self) -> None:
        trigger, length, _, _ = self._draws.uniform(self._sensor, self._next)
        if trigger >= self._probability:
            self._next += 1
            return
        ticks = self._longest_ticks
        if self._uniform:
            ticks = 2 + int(length * (self._longest_ticks - 1))
        self._firsts.append(self._next)
        self._lasts.append(self._next + ticks - 1)
        self._next += ticks
