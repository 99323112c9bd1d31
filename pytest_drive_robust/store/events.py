"""What happens during a run, as small frozen facts: the one stream that progress and reports read.

One process hands them over directly; workers append them to a `journal` that the controller reads.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

_KINDS: dict[str, type[Any]] = {}


@dataclass(frozen=True, slots=True)
class Event:
    """One of the facts below, which a line of a journal calls by the name of its class."""

    def __init_subclass__(cls) -> None:
        _KINDS[cls.__name__] = cls  # slots make a second class, which stays


@dataclass(frozen=True, slots=True)
class Planned(Event):
    """The episodes (by key) that the selected tests are known to need. May repeat: keys count once."""

    keys: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Advised(Event):
    """What the selected tests cannot show or do not judge, known before anything is driven; sentences."""

    sentences: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class NamesRegistered(Event):
    """These plugins register names of their own, in the words that `drive-robust -p` takes.

    Known after collection only: a `conftest.py` below the root folder is read with the tests beside it.
    """

    plugins: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Identified(Event):
    """What `agent` and the routes of a scope are made of, so that another run can tell whether it used the same.

    `distribution` is `"some-agents 1.2"`, `source` and `weights` are digests; each is empty when it is not known.
    `routes` are `"id=digest"`, one for each route of the scope.
    """

    agent: str
    distribution: str
    source: str
    weights: str
    routes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class EpisodesNeeded(Event):
    """A test needs these episodes (by key): one agent under one setting over routes x seeds.

    `clean_keys` are their clean twins, empty when nobody asked to compare.
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

    `likely` is how many routes it probably takes, as far as one can tell before anything was read.
    `keys` stand in the order of reading.
    `clean_keys` are their clean twins under the setting `clean`, empty when the verdict compares with nothing.
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
    """So many routes were read for a verdict, which probably takes `likely` of them in all."""

    requirement: str
    agent: str
    routes_spec: str
    seeds: tuple[int, ...]
    routes: int
    likely: int


@dataclass(frozen=True, slots=True)
class Spared(Event):
    """A verdict was in before these episodes (by key) were needed. Another test may still want them."""

    keys: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Used(Event):
    """A verdict or a measured value rests on these episodes (by key): what reports may show."""

    keys: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Compiling(Event):
    """So many functions are compiled, of `total` that episodes wait for; equal when none is missing any more."""

    done: int
    total: int


@dataclass(frozen=True, slots=True)
class Started(Event):
    """An episode began. `route` is the label of the route, for people; so many are driven `together` by one process."""

    key: str
    agent: str
    setting: str
    route: str
    together: int = 1


@dataclass(frozen=True, slots=True)
class Finished(Event):
    """An episode ended and is stored. `wall_s` is how many seconds it took."""

    key: str
    wall_s: float


@dataclass(frozen=True, slots=True)
class Reused(Event):
    """An episode was needed and found in the store, driven by another process or by an earlier run in `wall_s`."""

    key: str
    wall_s: float


@dataclass(frozen=True, slots=True)
class StoreTroubled(Event):
    """Something is wrong with the place that keeps the episodes; the run goes on."""

    sentence: str


@dataclass(frozen=True, slots=True)
class Judged(Event):
    """A requirement got its verdict in the test `nodeid`.

    `verdict` is `"pass"`, `"fail"`, `"inconclusive"` or `"error"`; for an error the numbers are None and `message` says
    why. `low` and `high` bound the interval of `value`, `routes` of `planned` were read by the rule `rule`. `p_value`
    is that against "it holds" where evidence was read; `family` is among how many requirements a fail had to stand,
    `margin` how far beyond the limit a pass may reach, in the unit of the metric.
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
    """A test asked for the largest severity that holds (`verdict.largest_severity`); `sentence` is the whole answer.

    `holds` and `breaks` are severities of `failure` in `unit`, None where none was found; `rule`: what they rest on.
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
    """Read what `event_to_json` wrote. Raises `ValueError` for a line that was cut off."""
    fields = json.loads(line)
    kind = _KINDS[fields.pop("event")]
    event: Event = kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()})
    return event
