"""How much is left of a run: which episodes its verdicts probably take, what each costs, how fast they are driven.

A verdict from evidence stops early, so nobody knows beforehand how many episodes there will be. For a verdict that is
being read its judge says how many routes it probably takes (`Read`); for one that is not, its limit does, and whether
the verdicts of this run took more or fewer than that. An episode costs what its clean twin cost, times what this
setting cost compared with its clean twins. Seconds of episodes become seconds of the clock by the slots in use; what an
episode waited for before it began, such as a compiler, is not counted.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable
from typing import NamedTuple

from pytest_drive_robust.store.events import Awaited, Event, Finished, Judged, Read, Started

__all__ = ["EpisodeCosts", "LikelyEpisodes", "Pace"]

_CLEAN = "clean"
_USUAL_EPISODE_S = 1.0
_USUAL_FACTOR = 1.3
"""What a perturbed episode costs compared with its clean twin, before one is known: 0.9 to 3 for `classical`."""
_USUAL_WEIGHT = 3.0
"""How many episodes of this run say as much as what is usual."""
_USUAL_VERDICTS = 3
"""How many verdicts of this run say as much as what is usual."""

_Ident = tuple[str, str, str, tuple[int, ...]]


class LikelyEpisodes:
    """Which episodes the requirements of the selected tests probably take, by key."""

    def __init__(self) -> None:
        self._open: dict[_Ident, Awaited] = {}
        self._likely: dict[_Ident, int] = {}
        self._all: set[str] = set()
        self._settings: set[tuple[str, str, tuple[int, ...], str]] = set()
        self._taken = [1.0] * _USUAL_VERDICTS

    def see(self, event: Event) -> None:
        """Take in an event."""
        if isinstance(event, Awaited):
            self._open.setdefault(_ident(event), event)
            self._all.update(event.keys, event.clean_keys)
            place = (event.agent, event.routes_spec, event.seeds)
            self._settings.update({(*place, event.setting), (*place, event.clean)})
        elif isinstance(event, Read):
            self._likely[_ident(event)] = event.likely
        elif isinstance(event, Judged):
            item = self._open.pop(_ident(event), None)
            if item is not None and item.rule != "point" and event.routes:
                self._taken.append(event.routes / max(1, item.likely))

    def covers(self, agent: str, routes_spec: str, seeds: tuple[int, ...], setting: str) -> bool:
        """Return True where a requirement is known to read episodes under this setting, so that it says how many."""
        return (agent, routes_spec, seeds, setting) in self._settings

    @property
    def sure(self) -> bool:
        """True when no verdict is left that may stop early."""
        return all(item.rule == "point" for item in self._open.values())

    def keys(self) -> set[str]:
        """Return the episodes that the open verdicts probably take."""
        likely: set[str] = set()
        for ident, item in self._open.items():
            count = self._likely_of(ident, item) * len(item.seeds)
            likely.update(item.keys[:count])
            likely.update(item.clean_keys[:count])
        return likely

    def unlikely(self, likely: Collection[str]) -> set[str]:
        """Return the episodes that requirements read and that are not among `likely`."""
        return self._all.difference(likely)

    def _likely_of(self, ident: _Ident, item: Awaited) -> int:
        planned = len(item.keys) // max(1, len(item.seeds))
        if item.rule == "point":
            return planned
        known = self._likely.get(ident, item.likely * _mean(self._taken, 1.0))
        return min(planned, math.ceil(known))


class _Kind(NamedTuple):
    """What decides what an episode costs."""

    agent: str
    setting: str
    route_id: str


class EpisodeCosts:
    """What the episodes of the plan cost in wall seconds, learnt from those that ended."""

    def __init__(self) -> None:
        self._kinds: dict[str, _Kind] = {}
        self._baselines = {_CLEAN}
        self._clean_s: dict[tuple[str, str], float] = {}
        self._perturbed: list[tuple[_Kind, float]] = []

    def see(self, event: Event) -> None:
        """Take in an event."""
        if isinstance(event, Awaited):
            kinds = zip(event.keys, event.route_ids, strict=True)
            self._kinds.update((key, _Kind(event.agent, event.setting, route)) for key, route in kinds)
            twins = zip(event.clean_keys, event.route_ids, strict=False)
            self._kinds.update((key, _Kind(event.agent, event.clean, route)) for key, route in twins)
            self._baselines.add(event.clean or _CLEAN)
        elif isinstance(event, Started):
            self._kinds.setdefault(event.key, _Kind(event.agent, event.setting, event.route.partition(" ")[0]))
        elif isinstance(event, Finished) and event.key in self._kinds:
            self._note(self._kinds[event.key], event.wall_s)

    def expected_s(self, keys: Iterable[str]) -> dict[str, float]:
        """Return the wall seconds that each of these episodes probably takes."""
        agents = self._means()
        usual = _mean(agents.values(), _USUAL_EPISODE_S)
        factors = self._factors(agents, usual)
        unknown = _mean((*self._clean_s.values(), *(wall_s for _, wall_s in self._perturbed)), _USUAL_EPISODE_S)
        expected = {}
        for key in keys:
            kind = self._kinds.get(key)
            if kind is None:
                expected[key] = unknown
                continue
            factor = 1.0 if kind.setting in self._baselines else factors.get((kind.agent, kind.setting), _USUAL_FACTOR)
            expected[key] = factor * self._twin_s(kind, agents, usual)
        return expected

    def _note(self, kind: _Kind, wall_s: float) -> None:
        if kind.setting in self._baselines:
            self._clean_s.setdefault((kind.agent, kind.route_id), wall_s)
        else:
            self._perturbed.append((kind, wall_s))

    def _means(self) -> dict[str, float]:
        """Return the mean of the clean episodes of each agent; of all its episodes where none of them is clean."""
        walls: dict[str, list[float]] = defaultdict(list)
        for (agent, _), wall_s in self._clean_s.items():
            walls[agent].append(wall_s)
        others: dict[str, list[float]] = defaultdict(list)
        for kind, wall_s in self._perturbed:
            others[kind.agent].append(wall_s / _USUAL_FACTOR)
        return {agent: _mean(values, _USUAL_EPISODE_S) for agent, values in {**others, **walls}.items()}

    def _twin_s(self, kind: _Kind, agents: dict[str, float], usual: float) -> float:
        return self._clean_s.get((kind.agent, kind.route_id), agents.get(kind.agent, usual))

    def _factors(self, agents: dict[str, float], usual: float) -> dict[tuple[str, str], float]:
        """Return for each setting that was driven what it costs compared with clean twins."""
        actual: dict[tuple[str, str], float] = defaultdict(float)
        twins: dict[tuple[str, str], float] = defaultdict(float)
        for kind, wall_s in self._perturbed:
            actual[kind.agent, kind.setting] += wall_s
            twins[kind.agent, kind.setting] += self._twin_s(kind, agents, usual)
        weight_s = _USUAL_WEIGHT * usual
        return {
            place: (wall_s + weight_s * _USUAL_FACTOR) / (twins[place] + weight_s) for place, wall_s in actual.items()
        }


class Pace:
    """How many seconds of episodes are driven in a second of the clock.

    Episodes that began before the first one of their agent ended may have waited for a compiler: they tell nothing.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._began_s: dict[str, tuple[str, float]] = {}
        self._ready: set[str] = set()
        self._waited: set[str] = set()
        self._slots = 0
        self._driven_s, self._held_s = _USUAL_WEIGHT, _USUAL_WEIGHT

    def see(self, event: Event) -> None:
        """Take in an event."""
        if isinstance(event, Started):
            self._began_s[event.key] = event.agent, self._clock()
            self._slots = max(self._slots, len(self._began_s))
            if event.agent not in self._ready:
                self._waited.add(event.key)
        elif isinstance(event, Finished):
            agent, began_s = self._began_s.pop(event.key, ("", self._clock()))
            self._ready.add(agent)
            if event.key not in self._waited:
                self._driven_s += event.wall_s
                self._held_s += max(event.wall_s, self._clock() - began_s)

    @property
    def per_second(self) -> float:
        """Return the slots seen in use, less what an episode holds its slot for beyond its own time."""
        return max(1, self._slots) * self._driven_s / self._held_s

    def running_s(self) -> dict[str, float]:
        """Return for how long each episode under way has held its slot."""
        return {key: self._clock() - began_s for key, (_, began_s) in self._began_s.items() if key not in self._waited}


def _ident(event: Awaited | Read | Judged) -> _Ident:
    return event.requirement, event.agent, event.routes_spec, event.seeds


def _mean(values: Iterable[float], otherwise: float) -> float:
    known = list(values)
    return math.fsum(known) / len(known) if known else otherwise
