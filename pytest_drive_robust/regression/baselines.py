"""Blessed baselines: `suites/baselines/<agent>.json`, small enough to be reviewed, one route per line.

A blessing adds and replaces the routes that its run drove. Other routes in the file stay, with their own blessing. Keys
are sorted, so that a diff shows only the changes.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.fingerprint import AgentPrint, Fingerprint
from pytest_drive_robust.regression.shape import misfit
from pytest_drive_robust.regression.snapshot import Cell, CellKey, RouteScore, Snapshot
from pytest_drive_robust.store.json_reader import read_json

SCHEMA = 1
"""The version of the file format. Increase it when a key changes its meaning or goes away."""
Place = tuple[str, str, str]
"""(simulator, setting, route id): the key of a blessed score."""
_ELSEWHERE = ("route_id", "fingerprint", "ds_of_seeds")
"""The fields of a score that its place and its blessing already hold, and the scores of single seeds."""


@dataclass(frozen=True, slots=True)
class Blessing:
    """Who accepted a run, when and why, and with what the run was driven; unknown fields are empty."""

    date: str
    reason: str
    by: str = ""
    run: str = ""
    commit: str = ""
    fingerprint: Fingerprint = field(default_factory=lambda: Fingerprint(""))


class BlessedRoute(NamedTuple):
    """An accepted score and the id of the blessing that accepted it."""

    blessing: str
    score: RouteScore


@dataclass(frozen=True, slots=True)
class Baseline:
    """The accepted scores of one agent: `blessings` by their id, `routes` by their place."""

    agent: str
    blessings: Mapping[str, Blessing] = field(default_factory=dict)
    routes: Mapping[Place, BlessedRoute] = field(default_factory=dict)

    def to_text(self) -> str:
        """Return the text of the file: sorted JSON, one route per line."""
        scores: dict[str, dict[str, dict[str, object]]] = {}
        for place in sorted(self.routes, key=lambda place: (*place[:2], _natural(place[2]))):
            simulator, setting, route_id = place
            scores.setdefault(simulator, {}).setdefault(setting, {})[route_id] = _route_json(self.routes[place])
        blessings = {name: _blessing_json(blessing) for name, blessing in sorted(self.blessings.items())}
        document = {"schema": SCHEMA, "agent": self.agent, "blessings": blessings, "scores": scores}
        levels = {"blessings": 1, "scores": 3}
        lines = [f"  {_text(name)}: {_text(value, levels.get(name, 0), '  ')}" for name, value in document.items()]
        return "{\n" + ",\n".join(lines) + "\n}\n"


def merge(old: Baseline, new: Baseline) -> Baseline:
    """Return `old` with the routes of `new`, which replace routes of equal place; every other place stays.

    Blessings without any route left are dropped; git remembers them. Raises `UsageError` when the two baselines are of
    different agents.
    """
    if old.agent != new.agent:
        raise UsageError(f"the baseline is of agent {old.agent!r}, expected {new.agent!r}.")
    names = {name: _free(name, blessing, old.blessings) for name, blessing in new.blessings.items()}
    fresh = {place: route._replace(blessing=names[route.blessing]) for place, route in new.routes.items()}
    routes = {**old.routes, **fresh}
    used = {route.blessing for route in routes.values()}
    blessings = {**old.blessings, **{names[name]: blessing for name, blessing in new.blessings.items()}}
    return Baseline(old.agent, {name: blessings[name] for name in blessings if name in used}, routes)


def baseline_file(folder: Path, agent: str) -> Path:
    """Return the path of an agent's baseline; a name with characters unsafe in file names gets a digest appended."""
    plain = re.sub(r"[^A-Za-z0-9_.-]+", "-", agent).strip("-.") or "agent"
    if plain != agent:
        plain += "-" + hashlib.blake2b(agent.encode(), digest_size=3).hexdigest()
    return folder / f"{plain}.json"


def read_baseline(path: Path) -> Baseline:
    """Read the baseline in `path`. Raises `UsageError` for a file that is no baseline."""
    return checked_baseline(read_json(path, name=f"the baseline {str(path)!r}"), path)


def checked_baseline(document: Any, path: Path) -> Baseline:
    """Return the baseline in the value that was read from `path`. Raises `UsageError` for one that is no baseline."""
    try:
        schema = document.get("schema", SCHEMA) if isinstance(document, dict) else SCHEMA
        if schema != SCHEMA:
            raise UsageError(f"{str(path)!r} has schema {schema!r}, this version reads {SCHEMA}.")
        if wrong := misfit(document, "baseline"):  # people edit the file, and git merges may break it
            raise UsageError(f"{str(path)!r} is not a baseline: {wrong}.")
        blessings = {name: _blessing(item) for name, item in document["blessings"].items()}
        routes = {
            (simulator, setting, route_id): _blessed_route(route_id, item, blessings)
            for simulator, settings in document["scores"].items()
            for setting, routes in settings.items()
            for route_id, item in routes.items()
        }
        return Baseline(document["agent"], blessings, routes)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{str(path)!r} is not a baseline: {type(error).__name__}: {error}.") from None


def _free(name: str, blessing: Blessing, taken: Mapping[str, Blessing]) -> str:
    """Return `name` with the first number that is free or that already names an equal blessing."""
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


def _blessed_route(route_id: str, item: Mapping[str, Any], blessings: Mapping[str, Blessing]) -> BlessedRoute:
    fields = {**item, "seeds": tuple(item["seeds"])}
    blessing = fields.pop("blessing")
    if blessing not in blessings:
        raise ValueError(f"route {route_id!r} names the blessing {blessing!r}, which is not there")
    return BlessedRoute(blessing, RouteScore(route_id, fingerprint=blessings[blessing].fingerprint, **fields))


def _blessing_json(blessing: Blessing) -> dict[str, object]:
    document = asdict(blessing)
    document["fingerprint"]["versions"] = dict(sorted(blessing.fingerprint.versions.items()))
    return {key: value if value != "" else None for key, value in document.items()}


def _route_json(route: BlessedRoute) -> dict[str, object]:
    score = asdict(route.score)
    return {"blessing": route.blessing, **{name: value for name, value in score.items() if name not in _ELSEWHERE}}


def _text(value: object, levels: int = 0, indent: str = "") -> str:
    """Return `value` as JSON text; the outer `levels` levels of objects have one line per key."""
    if not levels or not isinstance(value, dict):
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    lines = [f"{indent}  {_text(key)}: {_text(item, levels - 1, indent + '  ')}" for key, item in value.items()]
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def _natural(text: str) -> list[tuple[int, int, str]]:
    """Return a sort key that puts `"merge-v0-2"` before `"merge-v0-10"`."""
    return [(0, int(part), part) if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", text)]


def blessed_snapshot(baselines: Iterable[Baseline], *, simulator: str | None, label: str) -> Snapshot:
    """Return the blessed scores for one simulator as a snapshot; `simulator` None means the only blessed simulator.

    Raises `UsageError` when nothing was blessed for the simulator, when `simulator` is None and there are several, and
    when two baselines are of one agent, because the order of reading would then decide.
    """
    baselines = list(baselines)
    twice = [agent for agent, count in Counter(baseline.agent for baseline in baselines).items() if count > 1]
    if twice:
        raise UsageError(
            f"{label} has more than one file of the agent {twice[0]!r}, so it is not clear which scores count. Keep "
            "the file that `drive-robust bless` writes, and move the others to another folder."
        )
    known = sorted({place[0] for baseline in baselines for place in baseline.routes})
    if simulator is None and len(known) == 1:
        simulator = known[0]
    if simulator is None or simulator not in known:
        asked = f"for the simulator {simulator!r}" if simulator else "for one simulator"
        raise UsageError(f"{label} holds nothing {asked}, only for: {', '.join(known) or 'none'}.")
    cells: dict[CellKey, dict[str, RouteScore]] = {}
    for baseline in baselines:
        for (world, setting, route_id), route in baseline.routes.items():
            if world == simulator:
                routes = cells.setdefault((baseline.agent, setting), {})
                routes[route_id] = route.score
    return Snapshot(label, {key: Cell(*key, "", routes) for key, routes in cells.items()})
