"""Estimates the time left of a run: the episodes that its verdicts probably read, their cost, and the pace of driving.

A verdict from evidence stops early, so the number of episodes is not known beforehand. While a verdict reads routes,
its judge estimates how many routes it will read (`RoutesRead`). Before that, the estimate comes from the limit, and is
corrected by how many routes the earlier verdicts of this run read. The cost of an episode comes from episodes of the
same agent and setting. Seconds of episodes become seconds of the clock by the slots in use; the time that an episode
waits before it begins, for example for a compiler, is not counted.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import fmean

from pytest_drive_robust.store.events import (
    EpisodesNeeded,
    Event,
    Finished,
    Judged,
    Reused,
    RoutesRead,
    Started,
    VerdictPlanned,
)

_CLEAN = "clean"
_USUAL_EPISODE_S = 1.0
_USUAL_FACTOR = 1.3
"""The usual cost of an episode under a failure, relative to a clean episode: 0.9 to 3 for `classical`."""
_USUAL_WEIGHT = 3.0
"""The weight of the usual cost, in episodes of this run."""
_USUAL_VERDICTS = 3
"""The weight of the usual number of routes, in verdicts of this run."""

_Ident = tuple[str, str, str, tuple[int, ...]]
_Kind = tuple[str, str]
"""An agent and a setting."""


class LikelyEpisodes:
    """Estimates which episodes (by key) the requirements of the selected tests will read."""

    def __init__(self) -> None:
        self._open: dict[_Ident, VerdictPlanned] = {}
        self._likely: dict[_Ident, int] = {}
        self.read_keys: set[str] = set()
        self._settings: set[tuple[str, str, tuple[int, ...], str]] = set()
        self._taken = [1.0] * _USUAL_VERDICTS

    def see(self, event: Event) -> None:
        """Take in an event."""
        if isinstance(event, VerdictPlanned):
            self._open.setdefault(_ident(event), event)
            self.read_keys.update(event.keys, event.clean_keys)
            place = (event.agent, event.routes_spec, event.seeds)
            self._settings.update({(*place, event.setting), (*place, event.clean)})
        elif isinstance(event, RoutesRead):
            self._likely[_ident(event)] = event.likely
        elif isinstance(event, Judged):
            item = self._open.pop(_ident(event), None)
            if item is not None and item.rule != "point" and event.routes:
                self._taken.append(event.routes / max(1, item.likely))

    def covers(self, needed: EpisodesNeeded) -> bool:
        """Return True when a planned verdict reads episodes of this setting, so that their number is estimated here."""
        return (needed.agent, needed.routes_spec, needed.seeds, needed.setting) in self._settings

    @property
    def sure(self) -> bool:
        """True when no verdict is left that may stop early."""
        return all(item.rule == "point" for item in self._open.values())

    def keys(self) -> set[str]:
        """Return the keys of the episodes that the open verdicts will probably read."""
        likely: set[str] = set()
        for ident, item in self._open.items():
            count = self._likely_of(ident, item) * len(item.seeds)
            likely.update(item.keys[:count])
            likely.update(item.clean_keys[:count])
        return likely

    def _likely_of(self, ident: _Ident, item: VerdictPlanned) -> int:
        planned = len(item.keys) // max(1, len(item.seeds))
        if item.rule == "point":
            return planned
        known = self._likely.get(ident, item.likely * _mean(self._taken, 1.0))
        return min(planned, math.ceil(known))


class EpisodeCosts:
    """Estimates the cost of the planned episodes in wall seconds, from episodes that ended in this or an earlier run.

    The cost of an episode is the mean over the episodes of its agent and setting. While few of these are known, a usual
    cost counts as much as `_USUAL_WEIGHT` episodes: the mean of the agent's clean episodes, times `_USUAL_FACTOR` under
    a failure. An earlier run may have had a slower or busier machine, so its seconds are multiplied by the ratio of
    this run's seconds to the seconds that the earlier run lets expect.
    """

    def __init__(self) -> None:
        self._kinds: dict[str, _Kind] = {}
        self._baselines = {_CLEAN}
        self._driven_s: dict[_Kind, list[float]] = defaultdict(list)
        self._stored_s: dict[_Kind, list[float]] = defaultdict(list)
        self._compared: list[tuple[float, float]] = []

    def see(self, event: Event) -> None:
        """Take in an event."""
        if isinstance(event, VerdictPlanned):
            self._kinds.update(dict.fromkeys(event.keys, (event.agent, event.setting)))
            self._kinds.update(dict.fromkeys(event.clean_keys, (event.agent, event.clean)))
            self._baselines.add(event.clean or _CLEAN)
        elif isinstance(event, Started):
            self._kinds.setdefault(event.key, (event.agent, event.setting))
        elif isinstance(event, Reused) and event.key in self._kinds:
            self._stored_s[self._kinds[event.key]].append(event.wall_s)
        elif isinstance(event, Finished) and event.key in self._kinds:
            kind = self._kinds[event.key]
            if any(walls and agent == kind[0] for (agent, _), walls in self._stored_s.items()):
                self._compared.append((event.wall_s, self._costs(self._stored_s)[0].get(kind, 0.0)))
            self._driven_s[kind].append(event.wall_s)

    def expected_s(self, keys: Iterable[str]) -> dict[str, float]:
        """Return the expected wall seconds of each of these episodes, by key."""
        longer = self._times_longer()
        walls_s = {
            kind: [*self._driven_s.get(kind, ()), *(longer * wall_s for wall_s in self._stored_s.get(kind, ()))]
            for kind in {*self._driven_s, *self._stored_s}
        }
        costs, usual = self._costs(walls_s)
        return {key: costs[self._kinds[key]] if key in self._kinds else usual for key in keys}

    def _times_longer(self) -> float:
        """Return the ratio of this run's wall seconds to the seconds that the stored episodes let expect."""
        if not self._compared:
            return 1.0
        took_s, expected_s = (math.fsum(column) for column in zip(*self._compared, strict=True))
        usual_s = _USUAL_WEIGHT * expected_s / len(self._compared)
        return (took_s + usual_s) / (expected_s + usual_s) if expected_s else 1.0

    def _costs(self, walls_s: Mapping[_Kind, Sequence[float]]) -> tuple[dict[_Kind, float], float]:
        """Return the seconds of each kind of episode, given known wall seconds, and the seconds of an unknown kind."""
        agents: dict[str, list[float]] = defaultdict(list)
        for (agent, setting), walls in walls_s.items():
            if setting in self._baselines:
                agents[agent] += walls
        # At least `_USUAL_EPISODE_S`, because an unknown agent may be far slower than a quick known agent.
        usual = max(_mean((fmean(walls) for walls in agents.values() if walls), 0.0), _USUAL_EPISODE_S)
        costs = {}
        for agent, setting in set(self._kinds.values()):
            walls = walls_s.get((agent, setting), ())
            factor = 1.0 if setting in self._baselines else _USUAL_FACTOR
            prior = _USUAL_WEIGHT * factor * _mean(agents[agent], usual)
            costs[agent, setting] = (math.fsum(walls) + prior) / (len(walls) + _USUAL_WEIGHT)
        return costs, usual


class Pace:
    """Measures the seconds of episodes driven per second of the clock, and the seconds of the episodes under way.

    Episodes driven together share the time equally. An episode that began before the first episode of its agent ended
    is not counted, because it may have waited for a compiler.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._under_way: dict[str, tuple[Started, float, bool]] = {}
        self._ready: set[str] = set()
        self.per_second = 1.0

    def see(self, event: Event) -> None:
        """Take in an event. The pace is the largest number of slots ever seen in use."""
        if isinstance(event, Started):
            self._under_way[event.key] = event, self._clock(), event.agent in self._ready
            in_use = math.fsum(1.0 / started.together for started, _, _ in self._under_way.values())
            self.per_second = max(self.per_second, in_use)
        elif isinstance(event, Finished) and event.key in self._under_way:
            self._ready.add(self._under_way.pop(event.key)[0].agent)

    def running_s(self) -> dict[str, float]:
        """Return by key how long each episode under way has been driven, in seconds of the episode."""
        now_s = self._clock()
        return {
            key: (now_s - began_s) / started.together
            for key, (started, began_s, ready) in self._under_way.items()
            if ready
        }


def _ident(event: VerdictPlanned | RoutesRead | Judged) -> _Ident:
    return event.requirement, event.agent, event.routes_spec, event.seeds


def _mean(values: Iterable[float], otherwise: float) -> float:
    known = list(values)
    return math.fsum(known) / len(known) if known else otherwise
