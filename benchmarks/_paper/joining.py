"""Join files of driven episodes of several agents, settings, routes and seeds.

A drive of all agents on all routes takes days. The drive may come in pieces, each a report of its own, if all pieces
share one world, one definition of each route, and equal weights, options, versions and machine of each agent. Machines
are equal if they compute the same bits; a file that does not name its machine fits to any.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

from _paper.published import AGENTS
from _paper.readings import DRIVEN, clean_of
from _paper.reports import read_file
from _paper.results import OUR_CODE, DrivenAgent, Results, Scores, SeedScores, place_of
from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.result import MACHINE_FACTS
from pytest_drive_robust.errors import ComparisonError, UsageError

__all__ = ["read"]


@dataclass(frozen=True, slots=True)
class _Part:
    """The drives of one agent with one seed on some of the routes."""

    routes: tuple[str, ...]
    driven: DrivenAgent


def read(paths: Sequence[Path], replaced: Collection[str] = (), only: Collection[str] = ()) -> Results:
    """Read all files and join their results.

    If several files hold an agent on equal routes, each setting comes from the last file with that setting. Files with
    other routes or seeds add drives, and must hold equal agents and settings. The first file's drives of the agents in
    `replaced` are left out, because the other files hold drives with new weights. With `only`, drives of all other
    agents are left out.

    Raises the errors of `read_file`; `UsageError` for an agent in `replaced` that the first file or all other files
    lack, and for a file without an agent of `only`; `ComparisonError` for files of different worlds or definitions of a
    route, for files that share only some of their routes, for settings of one agent with different clean runs, and for
    agents, routes or seeds with missing drives.
    """
    world: Mapping[str, object] = {}
    routes: dict[str, tuple[str, str]] = {}
    parts: dict[tuple[str, int], list[_Part]] = defaultdict(list)
    for number, path in enumerate(paths):
        found = read_file(path)
        if only:
            found = _with(found, only, path)
        if number == 0:
            found = _without(found, replaced, path)
        if not found.agents:  # all agents replaced: ignore the world and the routes of that file
            continue
        _check_world(world or found.world, found.world, path)
        world = found.world
        _check_definitions(routes, found.routes, path)
        routes.update(found.routes)
        for name, seed, part in _parts_of(found):
            _put(parts[name, seed], part, f"{path}: {name}")
    if not parts:
        raise UsageError("no file was given. Expected JSON reports of suites/paper, or a results.json.")
    not_again = [name for name in replaced if name not in {key[0] for key in parts}]
    if not_again:
        raise UsageError(f"{', '.join(not_again)} to be replaced: no file after the first holds it. Give its reports.")
    whole = {key: _of_all_routes(key[0], of_key) for key, of_key in parts.items()}
    _check_same_routes(whole)
    seeds = tuple(sorted({seed for _, seed in whole}))
    agents = {
        name: _of_all_seeds(name, {seed: part.driven for seed in seeds if (part := whole.get((name, seed)))}, seeds)
        for name in AGENTS
        if any(name == key[0] for key in whole)
    }
    return Results(world, seeds, {route: routes[route] for route in sorted(routes, key=place_of)}, agents)


def _without(found: Results, replaced: Collection[str], path: Path) -> Results:
    unknown = [name for name in replaced if name not in found.agents]
    if unknown:
        raise UsageError(
            f"{', '.join(unknown)} to be replaced: {path}, the first file, holds {', '.join(found.agents)}."
        )
    kept = {name: driven for name, driven in found.agents.items() if name not in replaced}
    return replace(found, agents=kept)


def _with(found: Results, only: Collection[str], path: Path) -> Results:
    kept = {name: driven for name, driven in found.agents.items() if name in only}
    if not kept:
        raise UsageError(f"only {', '.join(only)} are wanted: {path} holds {', '.join(found.agents)}.")
    return replace(found, agents=kept)


def _parts_of(found: Results) -> Iterator[tuple[str, int, _Part]]:
    for name, driven in found.agents.items():
        for number, seed in enumerate(found.seeds):
            settings = {setting: Scores((of.of_seeds[number],)) for setting, of in driven.settings.items()}
            yield name, seed, _Part(tuple(found.routes), replace(driven, settings=settings))


def _check_world(first: Mapping[str, object], second: Mapping[str, object], path: Path) -> None:
    if first != second:
        raise ComparisonError(f"{path} was driven in {dict(second)}, the files before it in {dict(first)}.")


def _check_definitions(first: Mapping[str, tuple[str, str]], second: Mapping[str, tuple[str, str]], path: Path) -> None:
    other = [route for route in second if route in first and first[route] != second[route]]
    if other:
        raise ComparisonError(
            f"{path} was driven on other routes {', '.join(other[:5])} than the files before it: they have these ids, "
            "but another definition."
        )


def _put(parts: list[_Part], part: _Part, what: str) -> None:
    """Add `part` to `parts`; a part with equal routes is replaced or completed."""
    for number, earlier in enumerate(parts):
        if earlier.routes == part.routes:
            parts[number] = replace(part, driven=_completed(earlier.driven, part.driven, what))
            return
    for earlier in parts:
        shared = [route for route in part.routes if route in earlier.routes]
        if shared:
            raise ComparisonError(
                f"{what}: {len(shared)} of its {len(part.routes)} routes ({', '.join(shared[:5])}) are in a file "
                f"before it, too, which holds {len(earlier.routes)}. Give files of the same routes, or of none that "
                "are the same; --replace leaves out what the first file has of an agent."
            )
    parts.append(part)


def _completed(earlier: DrivenAgent, later: DrivenAgent, what: str) -> DrivenAgent:
    """Return `later` with the settings that only `earlier` has, if both have equal agents and equal clean drives."""
    lacking = [setting for setting in DRIVEN if setting in earlier.settings and setting not in later.settings]
    if not lacking:
        return later
    clean = [setting for setting in later.settings if setting == clean_of(setting) and setting in earlier.settings]
    changed = any(earlier.settings[setting] != later.settings[setting] for setting in clean)
    if changed or _facts(earlier) != _facts(later) or _library_that_differs([earlier, later]):
        raise ComparisonError(
            f"{what} lacks {', '.join(lacking)}, which the files before it have of another clean run (other "
            "weights, options, versions, --drive-stuck-stop or processor). A setting is compared with its own clean "
            "run: drive those again, too."
        )
    settings = _in_order({**earlier.settings, **later.settings})
    return replace(later, settings=settings, machine=_machine_of([earlier, later]))


def _facts(driven: DrivenAgent) -> tuple[object, ...]:
    """Return the facts that must be equal in joined files.

    The code may differ for an agent with weights: equal clean runs show that the agent still drives alike.
    """
    versions = sorted((name, version) for name, version in driven.versions.items() if name not in OUR_CODE)
    return driven.called, driven.stuck_stop_s, driven.made_of["weights"] or driven.made_of["source"], *versions


def _library_that_differs(drives: Iterable[DrivenAgent]) -> str | None:
    """Return a library that computes otherwise on one of the machines; a machine that is not known differs in none."""
    known = [driven.machine for driven in drives if driven.machine]
    for name, library in MACHINE_FACTS.items():
        if len({machine[name] for machine in known if name in machine}) > 1:
            return library
    return None


def _machine_of(drives: Sequence[DrivenAgent]) -> Mapping[str, str]:
    """Return what the machine of all drives computes; empty if one of them does not say."""
    return drives[0].machine if all(driven.machine == drives[0].machine for driven in drives) else {}


def _in_order(settings: Mapping[str, Scores]) -> dict[str, Scores]:
    return {setting: settings[setting] for setting in DRIVEN if setting in settings}


def _of_all_routes(name: str, parts: Sequence[_Part]) -> _Part:
    """Return the drives of one seed on the routes of all parts, in the order of the routes."""
    for first, second in combinations(parts, 2):
        of = [f"its {len(part.routes)} routes from {part.routes[0]} to {part.routes[-1]}" for part in (first, second)]
        _check_same_drives(name, first.driven, second.driven, of)
    routes = [route for part in parts for route in part.routes]
    order = sorted(range(len(routes)), key=lambda place: place_of(routes[place]))
    settings = {
        setting: Scores((_concatenated([part.driven.settings[setting].of_seeds[0] for part in parts], order),))
        for setting in parts[0].driven.settings
    }
    machine = _machine_of([part.driven for part in parts])
    return _Part(tuple(routes[place] for place in order), replace(parts[-1].driven, settings=settings, machine=machine))


def _concatenated(parts: Sequence[SeedScores], order: Sequence[int]) -> SeedScores:
    """Return the values of all parts, route `order[0]` of them first.

    Comfort is a mean over routes, so the comfort of a part is weighted by its number of routes.
    """
    if len(parts) == 1:
        return parts[0]
    driving_score = [value for part in parts for value in part.driving_score]
    success = [value for part in parts for value in part.success]
    efficiency = [value for part in parts for value in part.efficiency]
    comfort = [part.comfort for part in parts for _ in part.driving_score if part.comfort is not None]
    return SeedScores(
        tuple(driving_score[place] for place in order),
        tuple(success[place] for place in order),
        tuple(efficiency[place] for place in order),
        round(mean(comfort), 3) if comfort else None,
    )


def _check_same_routes(whole: Mapping[tuple[str, int], _Part]) -> None:
    (first_name, first_seed), first = next(iter(whole.items()))
    for (name, seed), part in whole.items():
        different = sorted(set(part.routes) ^ set(first.routes), key=place_of)
        if different:
            raise ComparisonError(
                f"{name} was driven with seed {seed} on {len(part.routes)} routes, {first_name} with seed {first_seed} "
                f"on {len(first.routes)}; different: {', '.join(different[:5])}. Agents are compared on the same "
                "routes only."
            )


def _of_all_seeds(name: str, drives: Mapping[int, DrivenAgent], seeds: Sequence[int]) -> DrivenAgent:
    """Return the drives of one agent with all seeds, in the order of `seeds`."""
    for first, second in combinations(seeds, 2):
        of = [f"seed {seed}" for seed in (first, second)]
        _check_same_drives(name, drives.get(first), drives.get(second), of)
    driven = drives[seeds[-1]]
    settings = {
        setting: Scores(tuple(drives[seed].settings[setting].of_seeds[0] for seed in seeds))
        for setting in driven.settings
    }
    return replace(driven, settings=settings, machine=_machine_of([drives[seed] for seed in seeds]))


def _check_same_drives(name: str, first: DrivenAgent | None, second: DrivenAgent | None, of: Sequence[str]) -> None:
    """Raise `ComparisonError` for drives that cannot be joined; `of` names `first` and `second` in the message."""
    ours, theirs = (() if one is None else tuple(one.settings) for one in (first, second))
    lacking = [setting for setting in DRIVEN if (setting in ours) != (setting in theirs)]
    if lacking:
        raise ComparisonError(
            f"{name} under {', '.join(lacking[:3])} was driven in one of these only: {of[0]}, {of[1]}. "
            "Drive it with the other, too, or leave that file out."
        )
    drives = [one for one in (first, second) if one is not None]
    if len(set(map(_facts, drives))) > 1:
        raise ComparisonError(
            f"{name} was driven with other weights, options, versions or --drive-stuck-stop in these: {of[0]}, "
            f"{of[1]}. Drive one of them again."
        )
    library = _library_that_differs(drives)
    if library is not None:
        raise ComparisonError(
            f"{name} was driven on machines whose {library} computes otherwise in these: {of[0]}, {of[1]}. "
            "Drive one of them again on the machine of the other."
        )
