"""Blessed baselines: `suites/baselines/<agent>.json`, small enough to be reviewed, one route a line.

A blessing adds and replaces the routes that its run drove; whatever else is in the file stays, with the blessing that
it came from. Keys are sorted, so a diff shows what changed and nothing else.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.fingerprint import AgentPrint, Fingerprint
from pytest_drive_robust.regression.snapshot import Cell, CellKey, RouteScore, Snapshot
from pytest_drive_robust.store.whole_file import write_whole

SCHEMA = 1
"""Grows when a key changes its meaning or goes away."""

Place = tuple[str, str, str]
"""(simulator, setting, route id): what a blessed score belongs to."""

_ELSEWHERE = ("route_id", "fingerprint")
"""What the place and the blessing of a score tell."""


@dataclass(frozen=True, slots=True)
class Blessing:
    """Who accepted a run, when and why, and what it was driven with. What is not known is empty."""

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
    """Everything that was accepted of one agent: `blessings` by their id, routes by their place."""

    agent: str
    blessings: Mapping[str, Blessing] = field(default_factory=dict)
    routes: Mapping[Place, BlessedRoute] = field(default_factory=dict)

    def to_text(self) -> str:
        """Return the file: sorted, one route a line."""
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
    """Put `new` over `old`: its routes replace those of the same place, every other place stays as it is.

    Blessings that no route refers to any more are dropped; git remembers them. Raises `UsageError` when the two are of
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
    """Return where the baseline of an agent is; a name that is no file name gets a digest behind what is left of it."""
    plain = re.sub(r"[^A-Za-z0-9_.-]+", "-", agent).strip("-.") or "agent"
    if plain != agent:
        plain += "-" + hashlib.blake2b(agent.encode(), digest_size=3).hexdigest()
    return folder / f"{plain}.json"


def read_baseline(path: Path) -> Baseline:
    """Read the baseline in `path`. Raises `UsageError` for a file that is none."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_without_twins)
        if document["schema"] != SCHEMA:
            raise UsageError(f"{str(path)!r} has schema {document['schema']!r}, this version reads {SCHEMA}.")
        blessings = {name: _blessing(item) for name, item in document["blessings"].items()}
        routes = {
            (simulator, setting, route_id): _blessed_route(route_id, item, blessings)
            for simulator, settings in document["scores"].items()
            for setting, routes in settings.items()
            for route_id, item in routes.items()
        }
        agent = document["agent"]
        if not isinstance(agent, str):
            raise TypeError(f"agent is {agent!r}, expected its name")
        return Baseline(agent, blessings, routes)
    except OSError as error:
        raise UsageError(f"the baseline {str(path)!r} cannot be read: {error.strerror}.") from None
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise UsageError(f"{str(path)!r} is not a baseline: {type(error).__name__}: {error}.") from None


def _without_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON. Raises `ValueError` for a key that it has twice, of which the last one would count.

    Who accepts both sides of a conflict in git has each changed route twice, the old score among them.
    """
    twice = [key for key, count in Counter(key for key, _ in pairs).items() if count > 1]
    if twice:
        raise ValueError(f"{twice[0]!r} stands there twice, as after a merge that kept both sides: remove one")
    return dict(pairs)


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


def _blessed_route(route_id: str, item: Mapping[str, Any], blessings: Mapping[str, Blessing]) -> BlessedRoute:
    fields = {**item, "seeds": tuple(item["seeds"])}
    blessing = fields.pop("blessing")
    score = RouteScore(route_id, fingerprint=blessings[blessing].fingerprint, **fields)
    if not (0.0 <= score.ds <= 100.0 and 0.0 <= score.sr <= 1.0):  # people edit the file, and git merges it
        raise ValueError(f"route {route_id!r} has ds={score.ds!r} and sr={score.sr!r}, expected 0 to 100 and 0 to 1")
    return BlessedRoute(blessing, score)


def _blessing_json(blessing: Blessing) -> dict[str, object]:
    document = asdict(blessing)
    document["fingerprint"]["versions"] = dict(sorted(blessing.fingerprint.versions.items()))
    return {key: value if value != "" else None for key, value in document.items()}


def _route_json(route: BlessedRoute) -> dict[str, object]:
    score = asdict(route.score)
    return {"blessing": route.blessing, **{name: value for name, value in score.items() if name not in _ELSEWHERE}}


def _text(value: object, levels: int = 0, indent: str = "") -> str:
    """Return JSON, the first `levels` levels of its objects with a line for each key."""
    if not levels or not isinstance(value, dict):
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    lines = [f"{indent}  {_text(key)}: {_text(item, levels - 1, indent + '  ')}" for key, item in value.items()]
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def _natural(text: str) -> list[tuple[int, int, str]]:
    """Return what sorts `"merge-v0-2"` before `"merge-v0-10"`."""
    return [(0, int(part), part) if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", text)]


@dataclass(frozen=True, slots=True)
class Blessed:
    """What happened to one file: how many scores are new, were replaced, were kept of others, and were dropped.

    `beside` of the kept ones are of other routes under settings of the run: runs without these are refused.
    """

    path: Path
    agent: str
    added: int
    replaced: int
    kept: int
    beside: int = 0
    dropped: int = 0


def bless(
    run: Snapshot,
    folder: Path,
    signature: Blessing,
    *,
    environ: Mapping[str, str],
    replace_routes: bool = False,
    only: bool = False,
) -> tuple[Blessed, ...]:
    """Write the scores of `run` into one file per agent in `folder`; what it did not drive stays as it was.

    With `only`, routes that it did not drive are dropped under the settings that it did drive.

    `signature` says who accepts it, when and why; its fingerprint is that of each agent's scores.
    Raises `UsageError` where `CI` is set in `environ`, without a reason, for a run that the simulator broke an episode
    of, that ended before its tests, that did without routes once its verdicts were in, or that holds no score, and,
    unless `replace_routes`, for routes that are others than the blessed ones of the same id. Nothing is written then.
    """
    _require_acceptable(run, signature, environ)
    prepared = []
    for agent in run.agents:
        path = baseline_file(folder, agent)
        old = read_baseline(path) if path.exists() else Baseline(agent)
        new = _baseline(run, agent, signature)
        if not new.routes:
            continue
        if not replace_routes:
            _require_same_routes(old, new)
        replaced = len(old.routes.keys() & new.routes.keys())
        beside = _beside(old, new)
        dropped = len(beside) if only else 0
        kept = replace(old, routes={place: old.routes[place] for place in old.routes if place not in beside})
        merged = merge(kept if only else old, new)
        others = len(old.routes) - replaced - dropped
        told = Blessed(path, agent, len(new.routes) - replaced, replaced, others, len(beside) - dropped, dropped)
        prepared.append((told, merged.to_text()))
    folder.mkdir(parents=True, exist_ok=True)
    for blessed, text in prepared:
        write_whole(blessed.path, text.encode("utf-8", "backslashreplace"))  # to JSON's escapes for half characters
    return tuple(blessed for blessed, _ in prepared)


def blessed_snapshot(baselines: Iterable[Baseline], *, simulator: str | None, label: str) -> Snapshot:
    """Return what was blessed for one simulator, as a run; for the only one there is when `simulator` is None.

    Raises `UsageError` when nothing was blessed for it, when it is not clear which one is meant, and when two of them
    are of one agent: which file was read last would decide.
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


def _require_acceptable(run: Snapshot, signature: Blessing, environ: Mapping[str, str]) -> None:
    if environ.get("CI"):
        raise UsageError(
            "CI is set in the environment, and CI never blesses: a baseline is accepted by a person. Fetch the run, "
            "bless it at your desk and commit the file."
        )
    if not signature.reason.strip():
        raise UsageError('a baseline needs a reason, as in --reason "new planner, see #12".')
    broken = [f"{cell.agent} under {cell.setting} on {told}" for cell in run.cells.values() for told in cell.broken]
    if broken:
        others = f" (and {len(broken) - 1} more)" if len(broken) > 1 else ""
        raise UsageError(
            f"{run.label} is incomplete: {broken[0]}{others}. It cannot become a baseline: run its command again."
        )
    stopped = [f"{routes} under {cell.setting}" for cell in run.cells.values() for routes in cell.stopped]
    if stopped:
        others = f" (and {len(stopped) - 1} more)" if len(stopped) > 1 else ""
        raise UsageError(
            f"{run.label} was driven until its verdicts were in, on {stopped[0]}{others}: later runs cannot be judged "
            "against that. Drive it with --drive-save, or with --drive-verdict=point."
        )
    if run.ended_early:
        raise UsageError(
            f"{run.label} is incomplete: not all of its tests came to their verdicts. It cannot become a baseline: run "
            "its command again."
        )
    if not any(cell.routes for cell in run.cells.values()):
        raise UsageError(f"{run.label} holds no score to bless.")


def _require_same_routes(old: Baseline, new: Baseline) -> None:
    others = [
        place
        for place, route in new.routes.items()
        if place in old.routes and old.routes[place].score.digest not in ("", route.score.digest)
    ]
    if others:
        _, setting, route_id = others[0]
        raise UsageError(
            f"{len(others)} routes are others than the blessed ones of the same id, first {route_id!r} under "
            f"{setting}. Give --replace-routes when the routes were changed on purpose."
        )


def _beside(old: Baseline, new: Baseline) -> set[Place]:
    """Return the routes of `old` that `new` lacks under its simulator and settings."""
    driven = {place[:2] for place in new.routes}
    return {place for place in old.routes if place[:2] in driven and place not in new.routes}


def _baseline(run: Snapshot, agent: str, signature: Blessing) -> Baseline:
    routes = {
        (score.fingerprint.simulator, setting, route_id): BlessedRoute(signature.date, score)
        for (name, setting), cell in run.cells.items()
        if name == agent
        for route_id, score in cell.routes.items()
    }
    prints = [route.score.fingerprint for route in routes.values()]  # a run has one for each agent
    return Baseline(agent, {signature.date: replace(signature, fingerprint=prints[0])} if prints else {}, routes)
