"""The results of driven episodes: score, success, efficiency of every agent, setting, route and seed.

A setting has its name in the report, so `200 ms latency (reading=released)` and `200 ms latency` are two settings;
`readings.py` chooses the settings of the table. Missing drives are never filled in: the agent or setting is absent.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pytest_drive_robust.arithmetic.signals import mean

__all__ = ["FORMAT", "OUR_CODE", "DrivenAgent", "Results", "Scores", "SeedScores", "place_of", "results_of", "text_of"]

FORMAT = "drive-robust paper table 4"
"""Format of the compact file. Format 1 had one reading and no comfort, format 2 one seed, format 3 one stop of standing
cars for all agents."""

OUR_CODE = ("pytest", "pytest-drive-robust")
"""Packages whose version changes with every commit without changing a number."""


@dataclass(frozen=True, slots=True)
class SeedScores:
    """Scores of one agent under one setting with one seed; one value per route, in the order of `Results.routes`.

    `driving_score` is 0..100; `efficiency` percent of the traffic's speed, None on a route without data; `comfort`
    percent of the segments, the mean over the routes with data, because a report has no comfort of single routes.
    """

    driving_score: tuple[float, ...]
    success: tuple[bool, ...]
    efficiency: tuple[float | None, ...]
    comfort: float | None


@dataclass(frozen=True)
class Scores:
    """Scores of one agent under one setting with all of `Results.seeds`; properties are means over seeds by route."""

    of_seeds: tuple[SeedScores, ...]

    @cached_property
    def driving_score(self) -> tuple[float, ...]:
        """Driving score of each route, 0..100."""
        return tuple(mean(of_route) for of_route in zip(*(one.driving_score for one in self.of_seeds), strict=True))

    @cached_property
    def success(self) -> tuple[float, ...]:
        """Share of seeds with success, for each route."""
        return tuple(mean(of_route) for of_route in zip(*(one.success for one in self.of_seeds), strict=True))

    @cached_property
    def efficiency(self) -> tuple[float | None, ...]:
        """Efficiency of each route in percent of the traffic's speed; None where no seed has data."""
        return tuple(map(_mean_of_known, zip(*(one.efficiency for one in self.of_seeds), strict=True)))

    @cached_property
    def comfort(self) -> float | None:
        """Comfort in percent of the segments."""
        return _mean_of_known(one.comfort for one in self.of_seeds)


def _mean_of_known(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return mean(known) if known else None


@dataclass(frozen=True, slots=True)
class DrivenAgent:
    """All drives of one agent, by setting. `called` is its name with options, `simlingo:tuning=published`.

    `made_of` identifies the agent's code and weights, `versions` its libraries. Its episodes ended when the car had
    stood still for `stuck_stop_s`, or only as the evaluator ends episodes (None). `machine` tells what its machine
    computes (`MACHINE_FACTS`); it is empty if some of the drives do not say.
    """

    called: str
    made_of: Mapping[str, str]
    versions: Mapping[str, str]
    settings: Mapping[str, Scores]
    stuck_stop_s: float | None = None
    machine: Mapping[str, str] = field(default_factory=dict)

    @property
    def driven_as(self) -> str:
        """The facts that must be equal in compared drives, even if the code has changed."""
        return f"{self.called} (weights {self.made_of.get('weights', 'none')}, stopped after {self.stuck_stop_s} s)"


@dataclass(frozen=True, slots=True)
class Results:
    """The results of all agents. `routes` maps each route id to its scenario type and the digest of its definition.

    `world`, the simulator with its version, is shared by all agents. `seeds` are the seeds of every route, in rising
    order.
    """

    world: Mapping[str, object]
    seeds: tuple[int, ...]
    routes: Mapping[str, tuple[str, str]]
    agents: Mapping[str, DrivenAgent]


def place_of(route: str) -> tuple[int, str]:
    """Return the sort key of a route: ids that are numbers first, by number, then other ids."""
    return (int(route), route) if route.isdecimal() else (2**31, route)


def text_of(results: Results) -> str:
    """Return the text of the compact file, `results.json`, with one line for each list of values."""
    agents = {
        name: {
            "called": driven.called,
            "made_of": driven.made_of,
            "versions": driven.versions,
            "machine": driven.machine,
            "stuck_stop_s": driven.stuck_stop_s,
            "settings": {
                setting: {
                    "driving_score": [one.driving_score for one in scores.of_seeds],
                    "success": [[int(value) for value in one.success] for one in scores.of_seeds],
                    "efficiency": [one.efficiency for one in scores.of_seeds],
                    "comfort": [one.comfort for one in scores.of_seeds],
                }
                for setting, scores in driven.settings.items()
            },
        }
        for name, driven in results.agents.items()
    }
    document = {
        "format": FORMAT,
        "world": results.world,
        "seeds": results.seeds,
        "routes": results.routes,
        "agents": agents,
    }
    return _json(document) + "\n"


def _json(value: object, indent: str = "") -> str:
    if not isinstance(value, Mapping) or not value:
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    inner = indent + " "
    lines = [f"{inner}{json.dumps(key)}: {_json(item, inner)}" for key, item in value.items()]
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def results_of(document: Mapping[str, Any]) -> Results:
    """Return the content of a compact file."""
    agents = {
        name: DrivenAgent(
            driven["called"],
            driven["made_of"],
            driven["versions"],
            {
                setting: Scores(tuple(map(_of_seed, *(lists[name] for name in _LISTS))))
                for setting, lists in driven["settings"].items()
            },
            driven["stuck_stop_s"],
            driven.get("machine", {}),
        )
        for name, driven in document["agents"].items()
    }
    routes = {route: (facts[0], facts[1]) for route, facts in document["routes"].items()}
    return Results(document["world"], tuple(document["seeds"]), routes, agents)


_LISTS = ("driving_score", "success", "efficiency", "comfort")


def _of_seed(
    driving_score: Iterable[float], success: Iterable[int], efficiency: Iterable[float | None], comfort: float | None
) -> SeedScores:
    return SeedScores(tuple(driving_score), tuple(map(bool, success)), tuple(efficiency), comfort)
