"""Events of a run, as small frozen dataclasses: progress display and reports read this one stream.

A run in one process passes events directly; xdist workers append events to a `journal` that the controller reads.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

_KINDS: dict[str, type[Any]] = {}


@dataclass(frozen=True, slots=True)
class Event:
    """Base of all events. A line of a journal names the event by its class name."""

    def __init_subclass__(cls) -> None:
        _KINDS[cls.__name__] = cls  # `slots=True` creates a second class, which replaces the first here


@dataclass(frozen=True, slots=True)
class Planned(Event):
    """The selected tests need these episodes (by key). A key that occurs in several events counts once."""

    keys: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Advised(Event):
    """Sentences that say, before any episode is driven, what the selected tests cannot show or do not judge."""

    sentences: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class NamesRegistered(Event):
    """These plugins register their own names; each plugin is written as `drive-robust -p` takes it.

    Sent after collection, because pytest reads a `conftest.py` below the root folder only with the tests beside it.
    """

    plugins: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Identified(Event):
    """Digests of `agent` and the routes of a scope, which tell whether another run used the same agent and routes.

    `distribution` is for example `"some-agents 1.2"`; `source` and `weights` are digests. Each of the three is empty
    when unknown. `routes` holds `"id=digest"` for each route of the scope.
    """

    agent: str
    distribution: str
    source: str
    weights: str
    routes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class EpisodesNeeded(Event):
    """A test needs these episodes (by key): one agent under one setting over routes x seeds.

    `clean_keys` are their clean twins; empty when the test compares with nothing.
    """

    agent: str
    routes_spec: str
    setting: str
    seeds: tuple[int, ...]
    keys: tuple[str, ...]
    clean_keys: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class VerdictPlanned(Event):
    """A selected test will read these episodes (by key), and may stop early unless `rule` is `"point"`.

    `likely` estimates how many routes the test will read, before the first route is read. `keys` stand in the order of
    reading. `clean_keys` are the clean twins under the setting `clean`; empty when the verdict compares with nothing.
    """

    requirement: str
    agent: str
    routes_spec: str
    seeds: tuple[int, ...]
    setting: str
    rule: str
    likely: int
    keys: tuple[str, ...]
    clean: str = ""
    clean_keys: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RoutesRead(Event):
    """A verdict has read `routes` routes so far and will probably read `likely` routes in all."""

    requirement: str
    agent: str
    routes_spec: str
    seeds: tuple[int, ...]
    routes: int
    likely: int


@dataclass(frozen=True, slots=True)
class Spared(Event):
    """A verdict was reached without these episodes (by key). Another test may still need them."""

    keys: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Used(Event):
    """A verdict or a measured value rests on these episodes (by key), so reports may show them."""

    keys: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Compiling(Event):
    """`done` of the `total` functions that episodes wait for are compiled; both are equal at the end."""

    done: int
    total: int


@dataclass(frozen=True, slots=True)
class Started(Event):
    """An episode began. `route` is a label for people; `together` is how many episodes the process drives at once."""

    key: str
    agent: str
    setting: str
    route: str
    together: int = 1


@dataclass(frozen=True, slots=True)
class Finished(Event):
    """An episode ended and is stored. `wall_s` is its wall-clock time in seconds."""

    key: str
    wall_s: float


@dataclass(frozen=True, slots=True)
class Reused(Event):
    """An episode was found in the store. Another process or an earlier run drove it in `wall_s` seconds."""

    key: str
    wall_s: float


@dataclass(frozen=True, slots=True)
class StoreTroubled(Event):
    """The store has a problem, which `sentence` describes; the run goes on."""

    sentence: str


@dataclass(frozen=True, slots=True)
class Judged(Event):
    """A requirement got its verdict in the test `nodeid`.

    `verdict` is `"pass"`, `"fail"`, `"inconclusive"` or `"error"`; for an error the numbers are None and `message` says
    why. `low` and `high` are the ends of the interval of `value`. The verdict rule `rule` read `routes` of `planned`
    routes. `p_value` tests "the requirement holds" where the rule read evidence. `family` is the number of requirements
    that a fail was corrected for. `margin` is how far beyond the limit a pass may reach, in the unit of the metric.
    """

    nodeid: str
    requirement: str
    agent: str
    routes_spec: str
    seeds: tuple[int, ...]
    metric: str
    setting: str
    comparison: str
    limit: float
    verdict: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    routes: int = 0
    message: str = ""
    planned: int = 0
    rule: str = ""
    p_value: float | None = None
    family: int = 1
    margin: float | None = None


@dataclass(frozen=True, slots=True)
class Searched(Event):
    """A test searched the largest severity that holds (`verdict.largest_severity`); `sentence` is the whole answer.

    `holds` and `breaks` are severities of `failure` in `unit`, or None when none was found. `rule` is the verdict rule
    of the search.
    """

    nodeid: str
    sentence: str
    agent: str
    routes_spec: str
    seeds: tuple[int, ...]
    failure: str
    unit: str
    metric: str
    comparison: str
    limit: float
    rule: str
    holds: float | None
    breaks: float | None
    undecided: tuple[float, ...] = ()


def event_to_json(event: Event) -> str:
    """Return the event as one line of JSON."""
    return json.dumps({"event": type(event).__name__, **asdict(event)})


def event_from_json(line: str) -> Event:
    """Return the event of a line that `event_to_json` wrote. Raises `ValueError` for a line that was cut off."""
    fields = json.loads(line)
    kind = _KINDS[fields.pop("event")]
    event: Event = kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()})
    return event
