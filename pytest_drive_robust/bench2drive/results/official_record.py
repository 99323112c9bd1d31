"""One route of an official result file, checked against the schema: a deviation is refused, never guessed.

Schema: Bench2Drive `leaderboard/utils/statistics_manager.py`, `RouteRecord`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from types import MappingProxyType
from typing import Any

from pytest_drive_robust.bench2drive.results.safe_json import finite, printable
from pytest_drive_robust.domain.outcome import End, InfractionKind, Outcome
from pytest_drive_robust.errors import UnknownNameError, UsageError

STATUSES: Mapping[str, tuple[Outcome, End]] = MappingProxyType(
    {
        "Completed": (Outcome.COMPLETED, End.COMPLETED),
        "Perfect": (Outcome.COMPLETED, End.COMPLETED),
        "Failed - Agent deviated from the route": (Outcome.FAILED, End.DEVIATED),
        "Failed - Agent got blocked": (Outcome.FAILED, End.BLOCKED),
        "Failed - Agent timed out": (Outcome.FAILED, End.TICK_CAP),
        "Failed - TickRuntime": (Outcome.FAILED, End.TICK_CAP),
        "Failed - Agent crashed": (Outcome.AGENT_ERROR, End.AGENT_CRASHED),
        "Failed - Agent couldn't be set up": (Outcome.AGENT_ERROR, End.AGENT_CRASHED),
        "Failed - Agent's sensors were invalid": (Outcome.AGENT_ERROR, End.AGENT_CRASHED),
        "Failed - Simulation crashed": (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED),
        # Ended without a reason, or never ended: the evaluator was interrupted.
        "Failed": (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED),
        "Started": (Outcome.INFRA_ERROR, End.SIMULATION_CRASHED),
        # Only our own exports have the next two.
        End.STUCK.value: (Outcome.FAILED, End.STUCK),
        End.ENVIRONMENT.value: (Outcome.FAILED, End.ENVIRONMENT),
    }
)
"""Every known status, with its outcome and its end."""
LISTS = tuple(kind.value for kind in InfractionKind)
"""The twelve lists of messages that every record has."""
EXTENSION = "drive_robust"
"""The key under which our exports keep what the official schema has no place for."""
SPEED_LIST = InfractionKind.MIN_SPEED.value
_ROUTE_ID = re.compile(r"RouteScenario_(.{1,200})_rep([0-9]{1,9})", re.DOTALL)
_NUMBERED = re.compile(r"_[0-9]+\Z")


@dataclass(frozen=True, slots=True)
class OfficialRecord:
    """`route` and `repetition` are the two parts of `route_id`; `route_pct` and `score` are 0..100.

    `scenario` is the type: the record's scenario name without its number. `game_s` and `wall_s` are at least 0.
    `own` holds the fields that our export adds, None for other records. `where` names the record and its file in
    messages.
    """

    where: str
    route_id: str
    route: str
    repetition: int
    scenario: str
    town: str
    save_name: str
    status: str
    infractions: Mapping[str, tuple[str, ...]]
    route_pct: float
    score: float
    length_m: float
    game_s: float
    wall_s: float
    own: Mapping[str, Any] | None = field(default=None, repr=False)

    @property
    def is_success(self) -> bool:
        """True by the official rule: completed, and no message in any list but that about the speed."""
        clear = all(not messages for name, messages in self.infractions.items() if name != SPEED_LIST)
        return STATUSES[self.status][0] is Outcome.COMPLETED and clear

    @property
    def is_harness_error(self) -> bool:
        """True when the record says nothing about the agent: it has a score only in the official totals."""
        return STATUSES[self.status][0] is Outcome.INFRA_ERROR


def read_record(given: object, where: str) -> OfficialRecord:
    """Return the record in a JSON value. Raises `UsageError` that names `where` and what was expected."""
    fields = _mapping(given, where)
    route_id = _text(fields, "route_id", where)
    parts = _ROUTE_ID.fullmatch(route_id)
    if parts is None:
        raise UsageError(f"{where}: route_id is {printable(route_id)}, expected 'RouteScenario_<id>_rep<number>'.")
    where = f"{where} ({printable(route_id, quotes=False)})"
    status = _text(fields, "status", where)
    if status not in STATUSES:
        raise UsageError(f"{where}: {UnknownNameError.of('status', printable(status, quotes=False), STATUSES)}")
    scores, meta = _mapping(fields.get("scores"), f"{where}, scores"), _mapping(fields.get("meta"), f"{where}, meta")
    own = fields.get(EXTENSION)
    return OfficialRecord(
        where=where,
        route_id=route_id,
        route=parts.group(1),
        repetition=int(parts.group(2)),
        scenario=_NUMBERED.sub("", _optional_text(fields, "scenario_name", where)),
        town=_optional_text(fields, "town_name", where),
        save_name=_optional_text(fields, "save_name", where),
        status=status,
        infractions=_infractions(fields.get("infractions"), where),
        route_pct=_number(scores, "score_route", where, high=100.0),
        score=_number(scores, "score_composed", where, high=100.0),
        length_m=_number(meta, "route_length", where),
        game_s=_duration_s(meta, "duration_game", where),
        wall_s=_duration_s(meta, "duration_system", where),
        own=None if own is None else _mapping(own, f"{where}, {EXTENSION}"),
    )


def _infractions(given: object, where: str) -> dict[str, tuple[str, ...]]:
    lists = _mapping(given, f"{where}, infractions")
    for name in LISTS:
        if name not in lists:
            raise UsageError(
                f"{where}: the infractions have no list {name!r}. Expected the twelve: {', '.join(LISTS)}."
            )
    found = {}
    for name, messages in lists.items():
        if not isinstance(messages, list) or not all(isinstance(message, str) for message in messages):
            raise UsageError(f"{where}: the infractions {printable(name)} are not a list of sentences.")
        found[name] = tuple(messages)
    return found


def _mapping(given: object, where: str) -> Mapping[str, Any]:
    if not isinstance(given, dict):
        raise UsageError(f"{where} is {printable(given)}, expected an object with names and values.")
    return given


def _text(fields: Mapping[str, Any], name: str, where: str) -> str:
    value = fields.get(name)
    if not isinstance(value, str):
        raise UsageError(f"{where}: {name} is {printable(value)}, expected text.")
    return value


def _optional_text(fields: Mapping[str, Any], name: str, where: str) -> str:
    """Return the text, empty for null, which a route has that never began. Raises `UsageError` for other values."""
    return "" if fields.get(name) is None else _text(fields, name, where)


def _number(fields: Mapping[str, Any], name: str, where: str, *, high: float | None = None) -> float:
    value = finite(fields.get(name))
    if value is None or value < 0.0 or (high is not None and value > high):
        bounds = "of 0 or more" if high is None else f"in 0..{high:g}"
        raise UsageError(f"{where}: {name} is {printable(fields.get(name))}, expected a number {bounds}.")
    return value


def _duration_s(fields: Mapping[str, Any], name: str, where: str) -> float:
    """Return seconds, 0 for the -1 that the evaluator writes where it does not know the time."""
    return 0.0 if finite(fields.get(name)) == -1.0 else _number(fields, name, where)


# Matches the same texts as the official `\b\d+\.?\d*%`, which takes quadratic time on long rows of digits.
_OFFICIAL = re.compile(r"\b\d+(?:\.\d*)?%")
_NUMBER = r"(?<![\w.+-])([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)"
_SPEED = re.compile(_NUMBER + "%")
_LANES = re.compile(r"\((\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)% of the completed route\)")
LARGEST_PCT = 1e18
"""Largest speed in percent of the traffic's, for traffic at a micrometre per hour; sums of such values stay finite."""
_PLACE = re.compile(r"\(x=(-?\d+(?:\.\d+)?), y=(-?\d+(?:\.\d+)?)(?:, z=-?\d+(?:\.\d+)?)?\)")


def official_speed_pct(message: str) -> float | None:
    """Return the speed that the official tool reads (16 of `2e+16%`, 5 of `-5%`), or None where the tool fails."""
    found = _OFFICIAL.search(message)
    return None if found is None else float(found.group().rstrip("%"))


def speed_pct(message: str) -> float | None:
    """Return the ego's speed in percent of the traffic's, or None if the sentence has no possible speed."""
    found = _SPEED.search(message)
    value = math.nan if found is None else float(found.group(1))
    return value if 0.0 <= value <= LARGEST_PCT else None


def ratios_pct(record: OfficialRecord, *, read: Callable[[str], float | None] = speed_pct) -> list[float]:
    """Return the speed ratios in percent, as `read` reads them. Raises `UsageError` for a sentence without a number."""
    found = []
    for message in record.infractions[SPEED_LIST]:
        ratio = read(message)
        if ratio is None:
            raise UsageError(
                f"{record.where}: {SPEED_LIST} holds {printable(message)}, expected a sentence like "
                '"Average speed is 62.41% of the surrounding traffic\'s one".'
            )
        found.append(ratio)
    return found


def outside_lanes_pct(message: str) -> float | None:
    """Return the share of the driven route outside its lanes, 0..100, or None if the sentence does not tell it."""
    found = _LANES.search(message)
    value = math.nan if found is None else float(found.group(1))
    return value if 0.0 <= value <= 100.0 else None


def place_of(message: str) -> tuple[float, float]:
    """Return (x, y) of the infraction in metres; zeros if the sentence does not tell its place."""
    found = _PLACE.search(message)
    x_m, y_m = (0.0, 0.0) if found is None else (float(found.group(1)), float(found.group(2)))
    return (x_m, y_m) if math.isfinite(x_m) and math.isfinite(y_m) else (0.0, 0.0)


def speed_message(pct: float) -> str:
    """Return the official sentence about the speed, with an exact number without an exponent."""
    return f"Average speed is {_plain(pct)}% of the surrounding traffic's one"


def lanes_message(share_pct: float, driven_m: float) -> str:
    """Return the official sentence about the lanes; the global record is computed from its ninth word, the metres."""
    metres = round(share_pct / 100.0 * driven_m, 3)
    return (
        f"Agent went outside its route lanes for about {_plain(metres)} meters "
        f"({_plain(share_pct)}% of the completed route)"
    )


def _plain(value: float) -> str:
    """Return the shortest exact digits without an exponent."""
    return f"{Decimal(repr(float(value))):f}"
