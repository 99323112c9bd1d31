"""Draws routes: `python -m pytest_drive_robust.simulators.embedded.generate FILE.xml --seed 0 --per-type 2`.

Everything about a route follows from (seed, scenario type, number), so another seed gives other routes on other towns.
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

import numpy as np

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint, Waypoint, Weather
from pytest_drive_robust.simulators.embedded.geometry import arc_lengths, place
from pytest_drive_robust.simulators.embedded.map import CompiledTown, compile_town
from pytest_drive_robust.simulators.embedded.routes import save_routes
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS, ScenarioType, Site

__all__ = ["WEATHERS", "draw_route", "draw_routes", "main"]

WEATHERS = {
    "clear noon": Weather(cloudiness=5.0, sun_altitude_angle=60.0, fog_density=2.0),
    "cloudy": Weather(cloudiness=70.0, sun_altitude_angle=45.0, fog_density=5.0),
    "dusk": Weather(cloudiness=20.0, sun_altitude_angle=6.0, fog_density=5.0),
    "fog": Weather(cloudiness=60.0, sun_altitude_angle=35.0, fog_density=45.0, wetness=10.0),
    "rain": Weather(
        cloudiness=90.0, precipitation=60.0, precipitation_deposits=50.0, wetness=80.0, sun_altitude_angle=40.0
    ),
}
"""The plain variants that generated routes use."""

_WAYPOINT_STEP_M = 2.0


def draw_route(kind: ScenarioType, *, number: int, seed: int, route_id: str) -> Route:
    """One route of a scenario type."""
    text = f"{seed}\x1f{kind.name}\x1f{number}".encode()
    rng = np.random.Generator(
        np.random.Philox(key=np.frombuffer(hashlib.blake2b(text, digest_size=16).digest(), dtype=np.uint64))
    )
    site = kind.sites[number % len(kind.sites)]
    town_name = f"{site.style}{int(rng.integers(1, 1_000_000))}"
    town = compile_town(town_name)
    line = town.chain(site.chain)
    start, length = _span(town, site, line, rng)
    at = np.append(np.arange(start, start + length, _WAYPOINT_STEP_M), start + length)
    waypoints = tuple(Waypoint(*(round(v, 3) for v in place(line, s)[:2])) for s in at)
    x, y, heading = place(line, start + float(rng.uniform(*site.trigger_m)))
    trigger = TriggerPoint(round(x, 3), round(y, 3), 0.0, round(float(np.degrees(heading)), 3))
    names = list(WEATHERS)
    # the first routes of a type are in fair weather, later ones go through the variants
    weather = WEATHERS[names[0] if number == 0 else names[int(rng.integers(len(names)))]]
    spec = ScenarioSpec(f"{kind.name}_{number + 1}", kind.name, trigger, _parameters(kind, rng))
    return Route(route_id, town_name, waypoints, spec, weather)


def draw_routes(*, seed: int, per_type: int) -> list[Route]:
    """`per_type` routes of every scenario type; ids are 101, 102 for the first type, 201, ... for the second."""
    return [
        draw_route(kind, number=number, seed=seed, route_id=str(100 * (place_ + 1) + number + 1))
        for place_, kind in enumerate(SCENARIOS[name] for name in sorted(SCENARIOS))
        for number in range(per_type)
    ]


def _span(
    town: CompiledTown, site: Site, line: np.typing.NDArray[np.float64], rng: np.random.Generator
) -> tuple[float, float]:
    """(start, length) along the chain."""
    total = float(arc_lengths(line)[-1])
    length = float(rng.uniform(*site.length_m))
    if site.before_m is None:
        return float(rng.uniform(80.0, max(81.0, total - length - 80.0))), length
    lanes = [town.lane_map.lanes[k] for k in town.chains[site.chain]]
    before_junction = 0.0
    for lane in lanes:
        if lane.junction:
            break
        before_junction += float(arc_lengths(lane.centre)[-1])
    return before_junction - float(rng.uniform(*site.before_m)), length


def _parameters(kind: ScenarioType, rng: np.random.Generator) -> dict[str, dict[str, float]]:
    drawn = {name: {"value": round(float(rng.uniform(*limits)), 2)} for name, limits in kind.parameters.items()}
    for name, (low, high) in kind.intervals.items():
        first = round(float(rng.uniform(low, low + 0.3 * (high - low))), 1)
        drawn[name] = {"from": first, "to": round(float(rng.uniform(first + 0.5 * (high - low), high)), 1)}
    return drawn


def main(argv: list[str] | None = None) -> int:
    """Command line: draw a route file."""
    parser = argparse.ArgumentParser(prog="python -m pytest_drive_robust.simulators.embedded.generate")
    parser.add_argument("file", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--per-type", type=int, default=2)
    given = parser.parse_args(argv)
    routes = draw_routes(seed=given.seed, per_type=given.per_type)
    given.file.parent.mkdir(parents=True, exist_ok=True)
    save_routes(routes, given.file)
    print(f"{given.file}: {len(routes)} routes of {len(SCENARIOS)} scenario types, seed {given.seed}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
