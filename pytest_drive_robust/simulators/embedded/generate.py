"""Draw routes: `python -m pytest_drive_robust.simulators.embedded.generate FILE.xml --seed 0 --per-type 5`.

A route is a function of (seed, scenario type, number). Another seed gives other routes on other towns: the towns of
seed s have the numbers 1 + 1000 s to 1000 + 1000 s.
"""

from __future__ import annotations

import argparse
import csv
import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers, Range
from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint, Waypoint
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place, resample
from pytest_drive_robust.simulators.embedded.kernels.contacts import overlap
from pytest_drive_robust.simulators.embedded.map import CompiledTown, compile_town
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS, ScenarioType
from pytest_drive_robust.simulators.embedded.weathers import WEATHERS
from pytest_drive_robust.simulators.embedded.weave import weave
from pytest_drive_robust.simulators.embedded.world import World

ATTEMPTS = 20
"""Most draws of a route that cannot be laid, staged or started."""

SEEDS, TOWNS_PER_SEED = 999, 1000
"""Seeds are 0 to `SEEDS` - 1; each seed has `TOWNS_PER_SEED` town numbers of its own."""

_SITES = Path(__file__).parent / "route_files" / "sites.csv"
_RANGES = ("length_m", "trigger_m", "before_m", "changes_m")
_FAIR = ("clear noon", "cloudy noon", "wet noon")
_WAYPOINT_STEP_M = 2.0
_ROAD_LEFT_M = 80.0
_ELBOW_ROOM_M = 0.3


@dataclass(frozen=True, slots=True)
class Site:
    """A place where routes for a scenario type are drawn.

    `chain` names a chain of lanes of the town style, or several chains with lane changes between them:
    `"ramp.f0>road.right"`. `before_m` is the range of metres from the start to the chain's anchor (its first junction;
    on ramps, where the parallel lane begins or parts); with None the route starts anywhere. `length_m` is the range of
    the route length. `trigger_m` and `changes_m` (where each lane change begins) are ranges of metres from the start of
    the route. `texts` are parameter elements whose value is a word: `(("direction", "left"),)`.
    """

    style: str
    chain: str
    length_m: Range
    trigger_m: Range = (4.0, 14.0)
    before_m: Range | None = None
    changes_m: tuple[Range, ...] = ()
    texts: tuple[tuple[str, str], ...] = ()


@functools.cache
def all_sites() -> dict[str, tuple[Site, ...]]:
    """Return the sites by scenario type: the rows of `route_files/sites.csv`, in file order."""
    found: dict[str, tuple[Site, ...]] = {}
    with _SITES.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            length_m, trigger_m, before_m, changes_m = (_ranges(row[name]) for name in _RANGES)
            texts = (("direction", row["direction"]),) if row["direction"] else ()
            before = before_m[0] if before_m else None
            site = Site(row["style"], row["chain"], length_m[0], trigger_m[0], before, changes_m, texts)
            found[row["type"]] = (*found.get(row["type"], ()), site)
    return found


def _ranges(text: str) -> tuple[Range, ...]:
    """Return `"6..10 46..50"` as pairs of numbers."""
    return tuple((float(low), float(high)) for low, _, high in (each.partition("..") for each in text.split()))


def draw_routes(*, seed: int, per_type: int) -> list[Route]:
    """Return `per_type` routes of every scenario type; ids are 101, 102 for the first type, 201, ... for the second.

    Raises `RouteError` for a seed or a number out of range, and where no place can be found for a scenario.
    """
    if not 0 <= seed < SEEDS:
        raise RouteError(f"seed {seed} draws no routes: expected 0 to {SEEDS - 1}, each with towns of its own")
    if not 1 <= per_type <= 99:
        raise RouteError(f"{per_type} routes per scenario type cannot be numbered: expected 1 to 99")
    return [
        draw_route(SCENARIOS[name], number=number, seed=seed, route_id=str(100 * (k + 1) + number + 1))
        for k, name in enumerate(sorted(SCENARIOS))
        for number in range(per_type)
    ]


def draw_route(kind: ScenarioType, *, number: int, seed: int, route_id: str) -> Route:
    """Return a route of a type that can be laid, staged and started. Raises `RouteError` after `ATTEMPTS` draws."""
    reason = "it has no sites"
    sites = all_sites().get(kind.name, ())
    for attempt in range(ATTEMPTS if sites else 0):
        try:
            route = _attempt(
                kind,
                sites[number % len(sites)],
                number,
                seed,
                RandomNumbers.of(seed, kind.name, number, attempt),
                route_id,
            )
            world = World(route, seed=0)
        except RouteError as error:
            reason = str(error)
            continue
        blocker = _in_the_way(world)
        if blocker is None:
            return route
        reason = f"a {blocker} stands where the ego starts"
    raise RouteError(
        f"scenario {kind.name}, route number {number}, seed {seed}: no place found in {ATTEMPTS} draws. "
        f"The last reason: {reason}. Change the sites of the scenario."
    )


def _attempt(kind: ScenarioType, site: Site, number: int, seed: int, rng: RandomNumbers, route_id: str) -> Route:
    town_name = f"{site.style}{1 + TOWNS_PER_SEED * seed + rng.below(TOWNS_PER_SEED)}"
    line = _line(compile_town(town_name), site, rng)
    length = float(arc_lengths(line)[-1])
    at = np.append(np.arange(0.0, length - 0.1, _WAYPOINT_STEP_M), length)
    waypoints = tuple(Waypoint(*(round(v, 3) for v in place(line, s)[:2])) for s in at)
    x, y, heading = place(line, rng.uniform(*site.trigger_m))
    trigger = TriggerPoint(round(x, 3), round(y, 3), 0.0, round(float(np.degrees(heading)), 3))
    # the first route of a type has fair weather, later routes draw from all weathers
    weather = str(rng.choice(_FAIR if number == 0 else tuple(WEATHERS)))
    spec = ScenarioSpec(f"{kind.name}_{number + 1}", kind.name, trigger, _parameters(kind, rng), dict(site.texts))
    return Route(route_id, town_name, waypoints, spec, WEATHERS[weather])


def _line(town: CompiledTown, site: Site, rng: RandomNumbers) -> Floats:
    """Return the route's line, a point every metre."""
    chains = site.chain.split(">")
    length = rng.uniform(*site.length_m)
    start = _start(town, site, chains[0], length, rng)
    changes = [rng.uniform(*limits) for limits in site.changes_m]
    return resample(weave(town, chains, start_m=start, changes_m=changes, length_m=length))


def _start(town: CompiledTown, site: Site, chain: str, length: float, rng: RandomNumbers) -> float:
    """Draw where the route starts, in metres along its first chain."""
    total = float(arc_lengths(town.chain(chain))[-1])
    if site.before_m is None:
        return float(rng.uniform(_ROAD_LEFT_M, max(_ROAD_LEFT_M + 1.0, total - length - _ROAD_LEFT_M)))
    anchor = town.anchor_m(chain)
    if anchor is None:
        raise RouteError(
            f"site {site.style} {site.chain!r} has before_m, but chain {chain!r} has no junction, bend or ramp to "
            "measure from: leave before_m out"
        )
    start = anchor - rng.uniform(*site.before_m)
    if start < 0.0:
        raise RouteError(f"site {site.style} {site.chain!r}: before_m is longer than the {anchor:.0f} m of road")
    return start


def _parameters(kind: ScenarioType, rng: RandomNumbers) -> dict[str, dict[str, float]]:
    drawn = {name: {"value": round(rng.uniform(*limits), 2)} for name, limits in kind.parameters.items()}
    for name, (low, high) in kind.intervals.items():
        first = round(float(rng.uniform(low, low + 0.3 * (high - low))), 1)
        drawn[name] = {"from": first, "to": round(float(rng.uniform(first + 0.5 * (high - low), high)), 1)}
    return drawn


def _in_the_way(world: World) -> str | None:
    """Return the kind of an actor that overlaps the ego's start, or None."""
    now = world.now()
    ego = now.ego
    room = ego.length_m + 2.0 * _ELBOW_ROOM_M, ego.width_m + 2.0 * _ELBOW_ROOM_M
    for actor in now.actors:
        place_ = actor[[now.X, now.Y, now.YAW, now.LENGTH, now.WIDTH]]
        kind = ActorKind(int(actor[now.KIND]))
        depth = overlap(ego.x_m, ego.y_m, ego.yaw_rad, *room, *(float(value) for value in place_))[0]
        if depth > 0.0 and kind is not ActorKind.DIRT:
            return kind.name.lower()
    return None


def main(argv: list[str] | None = None) -> int:
    """Run the command line: draw routes and write a route file."""
    parser = argparse.ArgumentParser(prog="python -m pytest_drive_robust.simulators.embedded.generate")
    parser.add_argument("file", type=Path)
    parser.add_argument("--seed", type=int, default=0, help=f"0 to {SEEDS - 1}; no two seeds share a town")
    parser.add_argument("--per-type", type=int, default=5, help="routes of each scenario type")
    given = parser.parse_args(argv)
    if given.file.is_dir():
        parser.exit(
            1, f"{given.file} is a directory: give the name of a file in it, such as {given.file / 'mine.xml'}\n"
        )
    try:
        routes = draw_routes(seed=given.seed, per_type=given.per_type)
        given.file.parent.mkdir(parents=True, exist_ok=True)
        save_routes(routes, given.file)
    except RouteError as error:
        parser.exit(1, f"{error}\n")
    except OSError as error:
        parser.exit(1, f"{given.file} cannot be written: {error.filename or 'a file'}: {error.strerror or error}\n")
    print(f"{given.file}: {len(routes)} routes of {len(SCENARIOS)} scenario types, seed {given.seed}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
