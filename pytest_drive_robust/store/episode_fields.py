"""Converts an episode to plain JSON types and back, without its tables: trace, given observations and tracks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from typing import Any

import numpy as np

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Injection, Reception, Touch, Trace

NO_TICKS = Trace(np.zeros((0, len(Trace.COLUMNS))))
"""The empty trace of an episode whose ticks are not known."""
_TABLES = frozenset({"trace", "given", "tracks"})
_LARGEST = sys.float_info.max


def plain(value: Any) -> Any:
    """Convert `value` to plain JSON types: dataclasses to objects, enumerations to their values.

    Numpy scalars become Python numbers, because simulators compute with numpy.
    """
    if is_dataclass(value):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, Enum):
        return value.value
    return value.item() if getattr(value, "ndim", None) == 0 else value


def facts_of(result: EpisodeResult) -> dict[str, Any]:
    """Return the fields of an episode but its name and its tables; the trace is replaced by its digest."""
    facts = [item.name for item in fields(result) if item.name not in {"episode", *_TABLES}]
    return {**{name: plain(getattr(result, name)) for name in facts}, "trace_digest": result.trace.digest}


def fields_of(result: EpisodeResult) -> dict[str, Any]:
    """Return the name and the facts of an episode in one object, as reports write them."""
    return {**plain(result.episode), **facts_of(result)}


def result_of(told: Mapping[str, Any], *, trace: Trace = NO_TICKS, **tables: Any) -> EpisodeResult:
    """Return the episode result of the fields that `fields_of` wrote, each checked.

    `tables` are fields that are kept elsewhere, in their own types; they are taken as they are. Raises
    `AttributeError`, `KeyError`, `TypeError` or `ValueError` for damaged fields.
    """
    # A report leaves out the route completion of an `infra_error`.
    if told["route_completion_pct"] is None and told["outcome"] == Outcome.INFRA_ERROR.value:
        told = {**told, "route_completion_pct": 0.0}
    episode = Episode(_text(told["agent"]), _text(told["route_id"]), _text(told["setting"]), _seed(told["seed"]))
    facts = {
        name: read(told[name])
        for name, read in _FACTS.items()
        if name not in tables and (name in told or name not in _LATER)
    }
    return EpisodeResult(episode=episode, trace=trace, **facts, **tables)


def read_facts(told: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """Return some facts of an episode, each checked. Raises as `result_of` does."""
    return {name: _FACTS[name](told[name]) for name in names}


def unstorable(name: str, value: object) -> str | None:
    """Return why a record cannot hold `value` as the field `name` of an episode, or None when it can."""
    try:
        _FACTS[name](plain(value))
    except Exception as error:  # a simulator may return numbers of any type
        return f"{name}: {error}"
    return None


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected text, got {type(value).__name__}")
    return value


def _truth(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"expected true or false, got {type(value).__name__}")
    return value


def _whole(value: object) -> int:
    whole = _seed(value)
    if not 0 <= whole < 1 << 53:
        raise ValueError("expected a whole number of 0 or more")
    return whole


def _seed(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError("expected a whole number")
    return value


def _number(value: object, *, low: float = 0.0, high: float = _LARGEST) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        least = " of 0 or more" if low == 0.0 else ""
        bounds = f" in {low:g}..{high:g}" if high < _LARGEST else least
        raise ValueError(f"expected a finite number{bounds}, got {value!r}")
    return float(value)


def _several(read: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, ...]]:
    return lambda values: tuple(map(read, values))


def _object(cls: type, **readers: Callable[[Any], Any]) -> Callable[[Mapping[str, Any]], Any]:
    def read_object(told: Mapping[str, Any]) -> Any:
        made = {}
        for name, read in readers.items():
            value = told[name]
            try:
                made[name] = read(value)
            except (TypeError, ValueError) as error:
                raise ValueError(f"{name}: {error}") from None
        return cls(**made)

    return read_object


_coordinate = partial(_number, low=-_LARGEST)
_infraction = _object(
    Infraction, kind=InfractionKind, tick=_whole, detail=_text, x_m=_coordinate, y_m=_coordinate, share_pct=_number
)
_touch = _object(Touch, signal=_text, ticks=_whole, first_tick=_whole)
_reception = _object(
    Reception, cameras=_several(_text), consumes=_several(_text), observations=_whole, touched=_several(_touch)
)
_FACTS: Mapping[str, Callable[[Any], Any]] = {
    "scenario": _text,
    "outcome": Outcome,
    "end": End,
    "end_detail": _text,
    "route_completion_pct": partial(_number, high=100.0),
    "route_length_m": _number,
    "infractions": _several(_infraction),
    "speed_ratios_pct": _several(_number),
    "ticks": _whole,
    "dt_s": _number,
    "wall_s": _number,
    "schedule": _several(_object(Injection, perturbation=_text, signal=_text, first_tick=_whole, last_tick=_whole)),
    "privileged": _truth,
    "junction_passed": _truth,
    "versions": lambda told: {_text(name): _text(version) for name, version in told.items()},
    "inference_s": _several(_number),
    "reception": lambda told: None if told is None else _reception(told),
}
_LATER = ("inference_s", "reception")
"""The fields that a file may leave out."""
