"""Blessed baselines: `suites/baselines/<agent>.json`, small enough to be reviewed, one route a line.

A blessing adds and replaces the routes that its run drove; whatever else is in the file stays, with the blessing that
it came from. Keys are sorted, so a diff shows what changed and nothing else.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.fingerprint import AgentPrint, Fingerprint

__all__ = ["SCHEMA", "Baseline", "BlessedRoute", "Blessing", "Place", "baseline_file", "merge", "read_baseline"]

SCHEMA = 1
"""Grows when a key changes its meaning or goes away."""

Place = tuple[str, str, str]
"""(simulator, setting, route id): what a blessed score belongs to."""


@dataclass(frozen=True, slots=True)
class Blessing:
    """Who accepted a run, when and why, and what it was driven with. `by`, `run` and `commit` are empty if unknown."""

    date: str
    reason: str
    by: str
    run: str
    commit: str
    fingerprint: Fingerprint


@dataclass(frozen=True, slots=True)
class BlessedRoute:
    """An accepted score: `ds` 0..100 and `sr` 0..1, means over `seeds`; `digest` names the content of the route."""

    blessing: str
    scenario: str
    ds: float
    sr: float
    seeds: tuple[int, ...]
    worst_seed: int
    outcome: str
    digest: str


@dataclass(frozen=True, slots=True)
class Baseline:
    """Everything that was accepted of one agent: `blessings` by their id, routes by their place."""

    agent: str
    blessings: Mapping[str, Blessing] = field(default_factory=dict)
    routes: Mapping[Place, BlessedRoute] = field(default_factory=dict)

    def to_text(self) -> str:
        """Return the file: sorted, one route a line, numbers rounded to three digits."""
        lines = ["{", f'  "schema": {SCHEMA},', f'  "agent": {_line(self.agent)},', '  "blessings": {']
        lines += _joined(
            f"    {_line(name)}: {_line(_blessing_json(blessing))}" for name, blessing in sorted(self.blessings.items())
        )
        lines += ["  },", '  "scores": {']
        lines += _joined("\n".join(self._simulator(simulator)) for simulator in _firsts(self.routes))
        return "\n".join([*lines, "  }", "}"]) + "\n"

    def _simulator(self, simulator: str) -> Iterable[str]:
        yield f"    {_line(simulator)}: {{"
        settings = _firsts(place[1:] for place in self.routes if place[0] == simulator)
        yield from _joined("\n".join(self._setting(simulator, setting)) for setting in settings)
        yield "    }"

    def _setting(self, simulator: str, setting: str) -> Iterable[str]:
        yield f"      {_line(setting)}: {{"
        found = [(place[2], route) for place, route in self.routes.items() if place[:2] == (simulator, setting)]
        found.sort(key=lambda item: _natural(item[0]))
        yield from _joined(f"        {_line(route_id)}: {_line(_route_json(route))}" for route_id, route in found)
        yield "      }"


def merge(old: Baseline, new: Baseline) -> Baseline:
    """Put `new` over `old`: its routes replace those of the same place, every other place stays as it is.

    Blessings that no route refers to any more are dropped; git remembers them. Raises `UsageError` when the two are of
    different agents.
    """
    if old.agent != new.agent:
        raise UsageError(f"the baseline is of agent {old.agent!r}, expected {new.agent!r}.")
    names = {name: _free(name, blessing, old.blessings) for name, blessing in new.blessings.items()}
    fresh = {place: replace(route, blessing=names[route.blessing]) for place, route in new.routes.items()}
    routes = {**old.routes, **fresh}
    used = {route.blessing for route in routes.values()}
    blessings = {**old.blessings, **{names[name]: blessing for name, blessing in new.blessings.items()}}
    return Baseline(old.agent, {name: blessings[name] for name in blessings if name in used}, routes)


def baseline_file(folder: Path, agent: str) -> Path:
    """Return where the baseline of an agent is; a name that is no file name gets a digest behind what is left of it."""
    plain = re.sub(r"[^A-Za-z0-9_.-]+", "-", agent).strip("-.") or "agent"
    if plain != agent:
        plain += "-" + hashlib.blake2b(agent.encode(), digest_size=3).hexdigest()
    return folder / f"{plain}.json"


def read_baseline(path: Path) -> Baseline:
    """Read the baseline in `path`. Raises `UsageError` for a file that is none."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["schema"] != SCHEMA:
            raise UsageError(f"{str(path)!r} has schema {document['schema']!r}, this version reads {SCHEMA}.")
        baseline = Baseline(
            agent=document["agent"],
            blessings={name: _blessing(item) for name, item in document["blessings"].items()},
            routes={
                (simulator, setting, route_id): BlessedRoute(**{**item, "seeds": tuple(item["seeds"])})
                for simulator, settings in document["scores"].items()
                for setting, routes in settings.items()
                for route_id, item in routes.items()
            },
        )
        lost = [route.blessing for route in baseline.routes.values() if route.blessing not in baseline.blessings]
    except OSError as error:
        raise UsageError(f"the baseline {str(path)!r} cannot be read: {error.strerror}.") from None
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise UsageError(f"{str(path)!r} is no baseline: {type(error).__name__}: {error}.") from None
    if lost:
        raise UsageError(f"{str(path)!r} refers to the blessing {lost[0]!r}, which it does not hold.")
    return baseline


def _free(name: str, blessing: Blessing, taken: Mapping[str, Blessing]) -> str:
    """Return `name` with the first number that is free, or that holds the same blessing."""
    number = 1
    while taken.get(f"{name}-{number}", blessing) != blessing:
        number += 1
    return f"{name}-{number}"


def _blessing(item: Mapping[str, Any]) -> Blessing:
    given = item["fingerprint"]
    fingerprint = Fingerprint(
        given["simulator"], given["stuck_stop_s"], AgentPrint(**given["agent"]), dict(given["versions"])
    )
    texts = {name: item[name] or "" for name in ("date", "reason", "by", "run", "commit")}
    return Blessing(**texts, fingerprint=fingerprint)


def _blessing_json(blessing: Blessing) -> dict[str, object]:
    document = asdict(blessing)
    document["fingerprint"]["versions"] = dict(sorted(blessing.fingerprint.versions.items()))
    return {key: value if value != "" else None for key, value in document.items()}


def _route_json(route: BlessedRoute) -> dict[str, object]:
    return {**asdict(route), "ds": round(route.ds, 3), "sr": round(route.sr, 3)}


def _line(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _joined(items: Iterable[str]) -> list[str]:
    """Put a comma behind all but the last."""
    listed = list(items)
    return [*(f"{item}," for item in listed[:-1]), *listed[-1:]]


def _firsts(places: Iterable[tuple[str, ...]]) -> list[str]:
    return sorted({place[0] for place in places})


def _natural(text: str) -> list[tuple[int, int, str]]:
    """Return what sorts `"merge-v0-2"` before `"merge-v0-10"`."""
    return [(0, int(part), part) if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", text)]
