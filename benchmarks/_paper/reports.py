"""Read driven episodes from the JSON report of a run of `suites/paper`, or from the committed compact file.

Both sources give equal values; `joining.py` joins several files. An agent that drove only some of the routes of a
setting is an error, and so are an episode without a score and a setting without its clean drive: missing data never
becomes a zero.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from _paper.published import AGENTS
from _paper.readings import DRIVEN, clean_of
from _paper.results import FORMAT, DrivenAgent, Results, Scores, SeedScores, place_of, results_of
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import MACHINE_FACTS
from pytest_drive_robust.errors import ComparisonError, UsageError
from pytest_drive_robust.metrics.efficiency import LARGEST_RATIO_PCT

__all__ = ["read_file"]

_Episode = Mapping[str, Any]
_FEWEST_ROUTES = 2
"""Least number of routes; a single route has no spread, so no figure would have an interval."""

_KIND = FORMAT.rpartition(" ")[0]


def read_file(path: Path) -> Results:
    """Read one file.

    Raises `UsageError` for a file of another kind or of an older format, for an agent that the paper lacks, and for one
    agent with two choices of options. Raises `ComparisonError` for episodes without a score, for routes that lack a
    setting, and for a setting without its clean drive.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{path} cannot be read as JSON: {error}.") from error
    if isinstance(document, dict) and document.get("format") == FORMAT:
        return results_of(document)
    if isinstance(document, dict) and str(document.get("format")).startswith(_KIND):
        raise UsageError(
            f"{path} is of the format {document['format']!r}. Expected {FORMAT!r}, which says of each agent when "
            "a standing car is stopped: drive its agents again and give the reports."
        )
    if isinstance(document, dict) and document.get("schema") == 1 and "episodes" in document:
        return _of_report(document, path)
    raise UsageError(f"{path} is neither a report of --drive-json (schema 1) nor a results.json of this benchmark.")


def _of_report(document: Mapping[str, Any], path: Path) -> Results:
    settings, fingerprint, versions = document["settings"], document["fingerprint"], document["versions"]
    if len(settings["seeds"]) != 1 or settings["metrics"] != "bench2drive":
        raise UsageError(
            f"{path} has seeds {settings['seeds']} and metrics {settings['metrics']!r}. Expected one seed a report "
            "(drive each by a command of its own and give all reports) and `--drive-metrics bench2drive`."
        )
    episodes = _by_agent_and_setting(document["episodes"], path)
    called = _called(episodes, path)
    scenarios = {
        episode["route_id"]: episode["scenario"]
        for by_setting in episodes.values()
        for setting, of_setting in by_setting.items()
        if setting == clean_of(setting)
        for episode in of_setting
    }
    if len(scenarios) < _FEWEST_ROUTES:
        raise ComparisonError(
            f"{path} holds {len(scenarios)} clean routes of {', '.join(AGENTS)}. Expected at least {_FEWEST_ROUTES}."
        )
    routes = {route: (scenarios[route], fingerprint["routes"][route]) for route in sorted(scenarios, key=place_of)}
    libraries = {name: str(version) for name, version in versions.items()}
    comfort = _comfort(document["summaries"], len(routes))
    agents = {
        name: DrivenAgent(
            spec,
            fingerprint["agents"][spec],
            libraries,
            _driven(episodes[spec], list(routes), comfort.get(spec, {}), f"{path}: {spec}"),
            settings["stuck_stop_s"],
            _machine(episodes[spec], f"{path}: {spec}"),
        )
        for name, spec in called.items()
    }
    return Results({"simulator": versions["simulator"]}, tuple(settings["seeds"]), routes, agents)


def _by_agent_and_setting(episodes: Sequence[_Episode], path: Path) -> dict[str, dict[str, list[_Episode]]]:
    """Return the episodes by agent and setting, without settings that the paper lacks."""
    found: dict[str, dict[str, list[_Episode]]] = defaultdict(lambda: defaultdict(list))
    for episode in episodes:
        if episode["setting"] in DRIVEN:
            found[episode["agent"]][episode["setting"]].append(episode)
    return found


def _called(specs: Iterable[str], path: Path) -> dict[str, str]:
    """Return the paper's agent for each agent with options: `simlingo:tuning=published` is `simlingo`."""
    called: dict[str, str] = {}
    for spec in sorted(specs):
        name = spec.partition(":")[0]
        if name not in AGENTS:
            raise UsageError(f"{path} holds the agent {spec!r}. The paper's are {', '.join(AGENTS)}.")
        if name in called:
            raise UsageError(
                f"{path} holds {called[name]!r} and {spec!r}. A table has one of them: give a report of one alone."
            )
        called[name] = spec
    return called


def _machine(by_setting: Mapping[str, Sequence[_Episode]], what: str) -> dict[str, str]:
    """Return what the machine computes that drove all these episodes; empty if some of them do not say."""
    told = [
        {name: version for name, version in episode["versions"].items() if name in MACHINE_FACTS}
        for of_setting in by_setting.values()
        for episode in of_setting
    ]
    for name, library in MACHINE_FACTS.items():
        if len({facts[name] for facts in told if name in facts}) > 1:
            raise ComparisonError(
                f"{what} was driven on machines whose {library} computes otherwise, so its episodes cannot be "
                "compared. Drive all of them on one of these machines (`--drive-fresh`)."
            )
    return told[0] if all(facts == told[0] for facts in told) else {}


def _comfort(summaries: Sequence[Mapping[str, Any]], routes: int) -> dict[str, dict[str, float | None]]:
    """Return the comfort by agent and setting, of the rows of a report that are over all routes."""
    found: dict[str, dict[str, float | None]] = defaultdict(dict)
    for row in summaries:
        summary = row["summary"]
        if summary is not None and summary["episodes"] == routes:
            found[row["agent"]][row["setting"]] = None if summary["comfort"] is None else round(summary["comfort"], 3)
    return found


def _driven(
    by_setting: Mapping[str, Sequence[_Episode]],
    routes: Sequence[str],
    comfort: Mapping[str, float | None],
    what: str,
) -> dict[str, Scores]:
    settings = [setting for setting in DRIVEN if setting in by_setting]
    cleans = dict.fromkeys(map(clean_of, settings))
    driven = {
        setting: _scores(by_setting.get(setting, ()), routes, comfort, f"{what} under {setting}")
        for setting in DRIVEN
        if setting in settings or setting in cleans
    }
    for setting in cleans:
        scored = sum(score > 0.0 for score in driven[setting].driving_score)
        if scored < _FEWEST_ROUTES:
            raise ComparisonError(
                f"{what} under {setting}: the clean driving score is 0 on {len(routes) - scored} of {len(routes)} "
                "routes, so its degradation is undefined."
            )
    return driven


def _scores(
    episodes: Sequence[_Episode], routes: Sequence[str], comfort: Mapping[str, float | None], what: str
) -> Scores:
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
    setting = episodes[0]["setting"]
    if setting not in comfort:
        raise ComparisonError(
            f"{what}: no summary over {len(routes)} routes, so its comfort is not known. Drive it again."
        )
    found = SeedScores(
        tuple(round(by_route[route]["driving_score"], 4) for route in routes),
        tuple(bool(by_route[route]["success"]) for route in routes),
        tuple(_efficiency(by_route[route]["speed_ratios_pct"]) for route in routes),
        comfort[setting],
    )
    return Scores((found,))


def _efficiency(ratios_pct: Sequence[float]) -> float | None:
    """Return the efficiency as `metrics.efficiency` in the mode `bench2drive`; a report has no `EpisodeResult`."""
    kept = [ratio for ratio in ratios_pct if ratio <= LARGEST_RATIO_PCT]
    return round(mean(kept), 3) if kept else None
