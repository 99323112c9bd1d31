"""Reads driven episodes: from the JSON report of a run of `suites/paper`, or from the compact file that is committed.

Whatever the source, the same values are rendered. An agent that drove only some of the routes of a setting is an
error, and so are an episode without a score and a setting without its clean drive: none of them is a zero.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from _paper.published import AGENTS
from _paper.readings import DRIVEN, clean_of
from _paper.results import FORMAT, DrivenAgent, Results, Scores, SeedScores, results_of
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import MACHINE_FACTS
from pytest_drive_robust.errors import ComparisonError, UsageError
from pytest_drive_robust.metrics.efficiency import LARGEST_RATIO_PCT

__all__ = ["read"]

_Episode = Mapping[str, Any]
_FEWEST_ROUTES = 2
"""One route has no spread, so nothing could have an interval."""

_OUR_CODE = ("pytest", "pytest-drive-robust")
"""Versions that change with every commit, and decide no number."""

_KIND = FORMAT.rpartition(" ")[0]


def read(paths: Sequence[Path]) -> Results:
    """Read all files as one. Of an agent that several files hold, each setting is that of the last file which has it.

    Files of other seeds are more drives of the same, and must hold the same agents and settings.

    Raises `UsageError` for a file that is neither kind or of a former format, or that holds an agent which the paper
    does not, or one agent under two choices of options; `ComparisonError` for episodes without a score, for routes that
    lack some setting, for a setting without its clean drive, for files of different routes or worlds, for settings
    of one agent that belong to different clean runs and for seeds that lack what others have.
    """
    by_seed: dict[int, Results] = {}
    for path in paths:
        for seed, found in _by_seed(_of_file(path)):
            if by_seed:
                _check_alike(next(iter(by_seed.values())), found, path)
            by_seed[seed] = _joined(by_seed[seed], found, path) if seed in by_seed else found
    if not by_seed:
        raise UsageError("no file was given. Expected JSON reports of suites/paper, or a results.json.")
    merged = _of_all_seeds([by_seed[seed] for seed in sorted(by_seed)])
    agents = {name: merged.agents[name] for name in AGENTS if name in merged.agents}
    return replace(merged, agents=agents)


def _of_file(path: Path) -> Results:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{path} cannot be read as JSON: {error}.") from error
    if isinstance(document, dict) and document.get("format") == FORMAT:
        return results_of(document)
    if isinstance(document, dict) and str(document.get("format")).startswith(_KIND):
        raise UsageError(
            f"{path} is of the format {document['format']!r}. Expected {FORMAT!r}, which has both readings, comfort "
            "and seeds: drive its agents again and give the reports."
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
    routes = {route: (scenarios[route], fingerprint["routes"][route]) for route in sorted(scenarios, key=_place)}
    kept = {key: str(value) for key, value in versions.items() if key not in MACHINE_FACTS}
    comfort = _comfort(document["summaries"], len(routes))
    agents = {
        name: DrivenAgent(
            spec,
            fingerprint["agents"][spec],
            kept,
            _driven(episodes[spec], list(routes), comfort.get(spec, {}), f"{path}: {spec}"),
        )
        for name, spec in called.items()
    }
    world = {"simulator": versions["simulator"], "stuck_stop_s": settings["stuck_stop_s"]}
    return Results(world, tuple(settings["seeds"]), routes, agents)


def _by_agent_and_setting(episodes: Sequence[_Episode], path: Path) -> dict[str, dict[str, list[_Episode]]]:
    """Group episodes; settings that the paper does not have are left out."""
    found: dict[str, dict[str, list[_Episode]]] = defaultdict(lambda: defaultdict(list))
    for episode in episodes:
        if episode["setting"] in DRIVEN:
            found[episode["agent"]][episode["setting"]].append(episode)
    return found


def _called(specs: Iterable[str], path: Path) -> dict[str, str]:
    """Return which agent of the paper each agent with its options is: `simlingo:tuning=published` is `simlingo`."""
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
    """Compute it as `metrics.efficiency` does in the mode `bench2drive`; a report holds no `EpisodeResult`."""
    kept = [ratio for ratio in ratios_pct if ratio <= LARGEST_RATIO_PCT]
    return round(mean(kept), 3) if kept else None


def _place(route: str) -> tuple[int, str]:
    return (int(route), route) if route.isdecimal() else (2**31, route)


def _check_alike(first: Results, second: Results, path: Path) -> None:
    if first.world != second.world:
        raise ComparisonError(f"{path} was driven in {dict(second.world)}, the files before it in {dict(first.world)}.")
    if first.routes != second.routes:
        different = set(first.routes.items()) ^ set(second.routes.items())
        shown = ", ".join(sorted({route for route, _ in different}, key=_place)[:5])
        raise ComparisonError(
            f"{path} holds {len(second.routes)} routes, the files before it {len(first.routes)}; different: {shown}. "
            "Agents are compared on the same routes only."
        )


def _joined(first: Results, second: Results, path: Path) -> Results:
    both = {
        name: _completed(first.agents[name], driven, f"{path}: {name}")
        for name, driven in second.agents.items()
        if name in first.agents
    }
    return replace(first, agents={**first.agents, **second.agents, **both})


def _by_seed(found: Results) -> Iterator[tuple[int, Results]]:
    """Yield the drives of each seed, so that a report of one seed can be put over results of several."""
    for number, seed in enumerate(found.seeds):
        agents = {
            name: replace(driven, settings={key: Scores((of.of_seeds[number],)) for key, of in driven.settings.items()})
            for name, driven in found.agents.items()
        }
        yield seed, replace(found, seeds=(seed,), agents=agents)


def _of_all_seeds(parts: Sequence[Results]) -> Results:
    """Return the drives of all seeds, in the order of `parts`, which have one each."""
    first, seeds = parts[0], tuple(seed for part in parts for seed in part.seeds)
    for part in parts[1:]:
        for name in {**first.agents, **part.agents}:
            _check_same_drives(name, [of.agents.get(name) for of in (first, part)], [first.seeds, part.seeds])
    agents = {
        name: replace(
            driven,
            settings={
                setting: Scores(tuple(one for part in parts for one in part.agents[name].settings[setting].of_seeds))
                for setting in driven.settings
            },
        )
        for name, driven in first.agents.items()
    }
    return replace(first, seeds=seeds, agents=agents)


def _check_same_drives(name: str, driven: Sequence[DrivenAgent | None], seeds: Sequence[tuple[int, ...]]) -> None:
    ours, theirs = (() if one is None else tuple(one.settings) for one in driven)
    lacking = [setting for setting in DRIVEN if (setting in ours) != (setting in theirs)]
    if lacking:
        raise ComparisonError(
            f"{name} under {', '.join(lacking[:3])} was driven with one of the seeds {seeds[0]} and {seeds[1]} only. "
            "Drive it with the others, too, or leave those files out."
        )
    if len({_facts(one) for one in driven if one is not None}) > 1:
        raise ComparisonError(
            f"{name} was driven with the seeds {seeds[0]} and {seeds[1]} by other weights, options or versions."
        )


def _facts(driven: DrivenAgent) -> tuple[object, ...]:
    """Return what must be the same in files that are put together.

    Code may be of another day where weights tell what drives: that it still drives the same is what a clean run shows.
    """
    versions = sorted((name, version) for name, version in driven.versions.items() if name not in _OUR_CODE)
    return driven.called, driven.made_of["weights"] or driven.made_of["source"], *versions


def _completed(earlier: DrivenAgent, later: DrivenAgent, what: str) -> DrivenAgent:
    """Return the later drive with the settings that only the earlier has, if the same agent drove the same cleanly."""
    lacking = [setting for setting in DRIVEN if setting in earlier.settings and setting not in later.settings]
    if not lacking:
        return later
    facts = [_facts(driven) for driven in (earlier, later)]
    clean = [setting for setting in later.settings if setting == clean_of(setting) and setting in earlier.settings]
    if facts[0] != facts[1] or any(earlier.settings[setting] != later.settings[setting] for setting in clean):
        raise ComparisonError(
            f"{what} lacks {', '.join(lacking)}, which the files before it have of another clean run (other "
            "weights, options, versions or processor). A setting is compared with its own clean run: drive those "
            "again, too."
        )
    settings = {**earlier.settings, **later.settings}
    return replace(later, settings={name: settings[name] for name in DRIVEN if name in settings})
