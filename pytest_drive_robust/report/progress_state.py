"""Sums up the events of a run: episodes done, episodes left, time left."""

from __future__ import annotations

from collections.abc import Callable

from pytest_drive_robust.report.numbers import left_text
from pytest_drive_robust.report.time_left import EpisodeCosts, LikelyEpisodes, Pace
from pytest_drive_robust.store.events import (
    Compiling,
    EpisodesNeeded,
    Event,
    Finished,
    Planned,
    Reused,
    Spared,
    Started,
    StoreTroubled,
)

_ALONE_S = 3.0
"""Seconds without a running episode after which another run must be driving: our own next episode begins sooner."""
_MOST_PASSED = 0.9
"""The largest share of a running episode that counts as done, however long the episode takes."""


class ProgressState:
    """The state of a run, summed up from its events. `clock` returns seconds, of which only differences count."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._next_since_s = clock()
        self._keys: set[str] = set()
        self._finished: set[str] = set()
        self._driven = 0
        self._spared: set[str] = set()
        self._open: list[EpisodesNeeded] = []
        self._running: dict[str, Started] = {}
        self._likely = LikelyEpisodes()
        self._costs = EpisodeCosts()
        self._pace = Pace(clock)
        self._left: frozenset[str] | None = None
        self._compiling: Compiling | None = None
        self._troubles: set[str] = set()

    def see(self, event: Event) -> list[EpisodesNeeded]:
        """Take in an event. Return the settings that the event completed."""
        self._left = None
        for part in (self._likely, self._costs, self._pace):
            part.see(event)
        if isinstance(event, Planned) or (isinstance(event, EpisodesNeeded) and not self._likely.covers(event)):
            self._keys.update(event.keys)
        if isinstance(event, EpisodesNeeded) and event not in self._open and not self._finished.issuperset(event.keys):
            self._open.append(event)
        if isinstance(event, EpisodesNeeded):
            self._spared.difference_update(event.keys)
        if isinstance(event, Spared):
            self._spared.update(event.keys)
        if isinstance(event, Started):
            self._running[event.key] = event
        if isinstance(event, (Finished, Reused)):
            self._running.pop(event.key, None)
            self._finished.add(event.key)
        if isinstance(event, (Planned, Finished)):
            self._next_since_s = self._clock()
        if isinstance(event, Finished):
            self._driven += 1
        if isinstance(event, (Compiling, Finished)):  # when an episode ends, no episode waits for the compiler
            self._compiling = event if isinstance(event, Compiling) and event.done < event.total else None
        if not isinstance(event, (EpisodesNeeded, Finished, Reused, Spared)):
            return []
        completed = [needed for needed in self._open if all(map(self._is_over, needed.keys))]
        self._open = [needed for needed in self._open if needed not in completed]
        return completed

    def trouble(self, event: Event) -> str:
        """Return a new problem of the store; empty for other events, and for a problem that another worker sent."""
        if not isinstance(event, StoreTroubled) or event.sentence in self._troubles:
            return ""
        self._troubles.add(event.sentence)
        return event.sentence

    @property
    def done(self) -> int:
        """The number of finished episodes."""
        return len(self._finished)

    @property
    def total(self) -> int:
        """The number of episodes finished or probably needed; verdicts may need fewer or more than estimated."""
        return self.done + len(self._to_drive())

    @property
    def left_s(self) -> float | None:
        """The estimated seconds left, without time for compiling; None before the first episode is finished."""
        if not self._driven:
            return None
        expected_s = self._costs.expected_s(self._to_drive())
        passed_s = self._pace.running_s().items()
        over_s = sum(min(seconds, _MOST_PASSED * expected_s.get(key, 0.0)) for key, seconds in passed_s)
        return (sum(expected_s.values()) - over_s) / self._pace.per_second

    @property
    def active(self) -> bool:
        """True while episodes are left to be driven."""
        return self.done < self.total

    def counts(self) -> str:
        """Return `"37/264 episodes, about 3 min left"`; `"37 of about 264 episodes"` while verdicts may come early."""
        total, left_s = self.total, self.left_s
        left = "" if left_s is None or self.done == total else f", {left_text(left_s)} left"
        return f"{self.done}{'/' if self._likely.sure else ' of about '}{total} episodes{left}"

    @property
    def compiled(self) -> tuple[int, int] | None:
        """(compiled functions, functions that episodes wait for), or None while nothing is being compiled."""
        return (self._compiling.done, self._compiling.total) if self._compiling is not None else None

    def compiling(self) -> str:
        """Return `"compiling, 31 of 140 functions done (kept for later runs)"`; empty while nothing is compiled."""
        if self.compiled is None:
            return ""
        done, total = self.compiled
        return f"compiling, {done} of {total} functions done (kept for later runs)"

    def _is_over(self, key: str) -> bool:
        return key in self._finished or key in self._spared

    def _to_drive(self) -> frozenset[str]:
        """Return the keys of the episodes that are probably needed and not finished."""
        if self._left is None:
            likely = self._likely.keys()
            needed = likely | (self._keys - self._spared - (self._likely.read_keys - likely))
            self._left = frozenset((needed | self._running.keys()) - self._finished)
        return self._left

    def now(self) -> str:
        """Return the episode under way that began last: `"classical, 200 ms latency, 501 HardBreakRoute"`.

        When no episode is under way for some seconds, another run with the same store drives the remaining episodes.
        """
        if not self._running:
            return "waiting for another run" if self._clock() - self._next_since_s >= _ALONE_S else ""
        last = list(self._running.values())[-1]
        others = f" (and {len(self._running) - 1} more)" if len(self._running) > 1 else ""
        return f"{last.agent}, {last.setting}, {last.route}{others}"
