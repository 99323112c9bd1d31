"""Reads driven episodes: from the JSON report of a run of `suites/paper`, or from the compact file that is committed.

Whatever the source, the same values are rendered. An agent that drove only some of the routes of a setting is an
error, and so is an episode without a score: neither is a zero.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from _paper.published import AGENTS, CLEAN, SETTINGS
from _paper.results import FORMAT, DrivenAgent, Results, Scores, results_of
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import MACHINE_FACTS
from pytest_drive_robust.errors import ComparisonError, UsageError
from pytest_drive_robust.metrics.efficiency import LARGEST_RATIO_PCT

__all__ = ["read"]

_Episode = Mapping[str, Any]
_FEWEST_ROUTES = 2
"""One route has no spread, so nothing could have an interval."""


def read(paths: Sequence[Path]) -> Results:
    """Read all files as one. Of an agent that several files hold, each setting is that of the last file which has it.

    Raises `UsageError` for a file that is neither kind, or that holds an agent which the paper does not;
    `ComparisonError` for episodes without a score, for routes that lack some setting, for files of different
    routes or worlds and for settings of one agent that belong to different clean runs.
    """
    merged: Results | None = None
    for path in paths:
        found = _of_file(path)
        merged = found if merged is None else _joined(merged, found, path)
    if merged is None:
        raise UsageError("no file was given. Expected JSON reports of suites/paper, or a results.json.")
    return Results(merged.world, merged.routes, {name: merged.agents[name] for name in AGENTS if name in merged.agents})


def _of_file(path: Path) -> Results:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{path} cannot be read as JSON: {error}.") from error
    if isinstance(document, dict) and document.get("format") == FORMAT:
        return results_of(document)
    if isinstance(document, dict) and document.get("schema") == 1 and "episodes" in document:
        return _of_report(document, path)
    raise UsageError(f"{path} is neither a report of --drive-json (schema 1) nor a results.json of this benchmark.")


def _of_report(document: Mapping[str, Any], path: Path) -> Results:
    settings, fingerprint, versions = document["settings"], document["fingerprint"], document["versions"]
    if len(settings["seeds"]) != 1 or settings["metrics"] != "bench2drive":
        raise UsageError(
            f"{path} has seeds {settings['seeds']} and metrics {settings['metrics']!r}. "
            "The paper's table has one seed and `--drive-metrics bench2drive`."
        )
    episodes = _by_agent_and_setting(document["episodes"], path)
    scenarios = {
        episode["route_id"]: episode["scenario"]
        for by_setting in episodes.values()
        for episode in by_setting.get(CLEAN, ())
    }
    if len(scenarios) < _FEWEST_ROUTES:
        raise ComparisonError(
            f"{path} holds {len(scenarios)} clean routes of {', '.join(AGENTS)}. Expected at least {_FEWEST_ROUTES}."
        )
    routes = {route: (scenarios[route], fingerprint["routes"][route]) for route in sorted(scenarios, key=_place)}
    kept = {key: str(value) for key, value in versions.items() if key not in MACHINE_FACTS}
    agents = {
        name: DrivenAgent(fingerprint["agents"][name], kept, _driven(by_setting, list(routes), f"{path}: {name}"))
        for name, by_setting in episodes.items()
    }
    world = {
        "simulator": versions["simulator"],
        "seed": settings["seeds"][0],
        "stuck_stop_s": settings["stuck_stop_s"],
    }
    return Results(world, routes, agents)


def _by_agent_and_setting(episodes: Sequence[_Episode], path: Path) -> dict[str, dict[str, list[_Episode]]]:
    """Group episodes; settings that the paper does not have are left out."""
    found: dict[str, dict[str, list[_Episode]]] = defaultdict(lambda: defaultdict(list))
    for episode in episodes:
        if episode["setting"] in (CLEAN, *SETTINGS):
            found[episode["agent"]][episode["setting"]].append(episode)
    unknown = sorted(name for name in found if name not in AGENTS)
    if unknown:
        raise UsageError(f"{path} holds the agent {unknown[0]!r}. The paper's are {', '.join(AGENTS)}.")
    return found


def _driven(by_setting: Mapping[str, Sequence[_Episode]], routes: Sequence[str], what: str) -> dict[str, Scores]:
    driven = {
        setting: _scores(by_setting.get(setting, ()), routes, f"{what} under {setting}")
        for setting in (CLEAN, *SETTINGS)
        if setting == CLEAN or setting in by_setting
    }
    if not any(driven[CLEAN].driving_score):
        raise ComparisonError(f"{what}: the clean driving score is 0, so its degradation is undefined.")
    return driven


def _scores(episodes: Sequence[_Episode], routes: Sequence[str], what: str) -> Scores:
    by_route = {episode["route_id"]: episode for episode in episodes}
    if set(by_route) != set(routes) or len(by_route) != len(episodes):
        lacking = [route for route in routes if route not in by_route]
        raise ComparisonError(
            f"{what}: {len(episodes)} episodes for {len(routes)} routes, lacking {', '.join(lacking[:5]) or 'none'}. "
            "Expected each route once under every setting: run the same command again, it drives only what lacks, "
            "and with --drive-verdict point nothing is stopped early."
        )
    unscored = [route for route in routes if by_route[route]["driving_score"] is None]
    if unscored:
        raise ComparisonError(
            f"{what}: no score on {', '.join(unscored[:5])} ({len(unscored)} routes). Drive them again."
        )
    return Scores(
        tuple(round(by_route[route]["driving_score"], 4) for route in routes),
        tuple(bool(by_route[route]["success"]) for route in routes),
        tuple(_efficiency(by_route[route]["speed_ratios_pct"]) for route in routes),
    )


def _efficiency(ratios_pct: Sequence[float]) -> float | None:
    """Compute it as `metrics.efficiency` does in the mode `bench2drive`; a report holds no `EpisodeResult`."""
    kept = [ratio for ratio in ratios_pct if ratio <= LARGEST_RATIO_PCT]
    return round(mean(kept), 3) if kept else None


def _place(route: str) -> tuple[int, str]:
    return (int(route), route) if route.isdecimal() else (2**31, route)


def _joined(first: Results, second: Results, path: Path) -> Results:
    if first.world != second.world:
        raise ComparisonError(f"{path} was driven in {dict(second.world)}, the files before it in {dict(first.world)}.")
    if first.routes != second.routes:
        different = set(first.routes.items()) ^ set(second.routes.items())
        shown = ", ".join(sorted({route for route, _ in different}, key=_place)[:5])
        raise ComparisonError(
            f"{path} holds {len(second.routes)} routes, the files before it {len(first.routes)}; different: {shown}. "
            "Agents are compared on the same routes only."
        )
    both = {
        name: _completed(first.agents[name], driven, f"{path}: {name}")
        for name, driven in second.agents.items()
        if name in first.agents
    }
    return Results(first.world, first.routes, {**first.agents, **second.agents, **both})


def _completed(earlier: DrivenAgent, later: DrivenAgent, what: str) -> DrivenAgent:
    """Return the later drive with the settings that only the earlier has, if their clean episodes are the same."""
    lacking = [
        setting for setting in (CLEAN, *SETTINGS) if setting in earlier.settings and setting not in later.settings
    ]
    if not lacking:
        return later
    facts = [(driven.made_of, driven.versions, driven.settings[CLEAN]) for driven in (earlier, later)]
    if facts[0] != facts[1]:
        raise ComparisonError(
            f"{what} lacks {', '.join(lacking)}, which the files before it have of another clean run (other code, "
            "weights, versions or processor). A setting is compared with its own clean run: drive those again, too."
        )
    settings = {**earlier.settings, **later.settings}
    return DrivenAgent(
        later.made_of, later.versions, {name: settings[name] for name in (CLEAN, *SETTINGS) if name in settings}
    )
