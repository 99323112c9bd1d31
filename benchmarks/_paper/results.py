"""Driven episodes as this benchmark keeps them: score, success, efficiency of every agent, setting, route and seed.

A setting is called as the report calls it, so that `200 ms latency (reading=released)` is another one than without
the brackets; `readings.py` says which of them stand in the table. Nothing is filled in: an agent or a setting that was
not driven is missing.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pytest_drive_robust.arithmetic.signals import mean

__all__ = ["FORMAT", "DrivenAgent", "Results", "Scores", "SeedScores", "place_of", "results_of", "text_of"]

FORMAT = "drive-robust paper table 4"
"""What the compact file says it is. The first one had one reading and no comfort, the second one seed, the
third one stop of standing cars for all agents."""


@dataclass(frozen=True, slots=True)
class SeedScores:
    """One agent under one setting with one seed; one value for each route, in the order of `Results.routes`.

    `driving_score` is 0..100; `efficiency` percent of the traffic's speed, None on a route without data; `comfort`
    percent of the segments, the mean over the routes that have data, because a report has it of no single route.
    """

    driving_score: tuple[float, ...]
    success: tuple[bool, ...]
    efficiency: tuple[float | None, ...]
    comfort: float | None


@dataclass(frozen=True)
class Scores:
    """One agent under one setting, with each of `Results.seeds`; for each route the mean over them."""

    of_seeds: tuple[SeedScores, ...]

    @cached_property
    def driving_score(self) -> tuple[float, ...]:
        """Of each route, 0..100."""
        return tuple(mean(of_route) for of_route in zip(*(one.driving_score for one in self.of_seeds), strict=True))

    @cached_property
    def success(self) -> tuple[float, ...]:
        """The share of the seeds with which each route was a success."""
        return tuple(mean(of_route) for of_route in zip(*(one.success for one in self.of_seeds), strict=True))

    @cached_property
    def efficiency(self) -> tuple[float | None, ...]:
        """Of each route, percent of the traffic's speed; None where no seed has data."""
        return tuple(map(_mean_of_known, zip(*(one.efficiency for one in self.of_seeds), strict=True)))

    @cached_property
    def comfort(self) -> float | None:
        """Percent of the segments."""
        return _mean_of_known(one.comfort for one in self.of_seeds)


def _mean_of_known(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return mean(known) if known else None


@dataclass(frozen=True, slots=True)
class DrivenAgent:
    """Everything that one agent drove, by setting. `called` is its name with its options, `simlingo:tuning=published`.

    `made_of` identifies its code and weights, `versions` what it ran on. Its episodes ended when the car had stood
    still for `stuck_stop_s`, or only as the evaluator ends them (None).
    """

    called: str
    made_of: Mapping[str, str]
    versions: Mapping[str, str]
    settings: Mapping[str, Scores]
    stuck_stop_s: float | None = None

    @property
    def driven_as(self) -> str:
        """What must be the same in drives that are compared, whatever of the code has changed."""
        return f"{self.called} (weights {self.made_of.get('weights', 'none')}, stopped after {self.stuck_stop_s} s)"


@dataclass(frozen=True, slots=True)
class Results:
    """`routes` maps each route id to its scenario type and the digest of its definition.

    `world` is what all agents must share: simulator with its version. `seeds` are those with which each route was
    driven, in rising order.
    """

    world: Mapping[str, object]
    seeds: tuple[int, ...]
    routes: Mapping[str, tuple[str, str]]
    agents: Mapping[str, DrivenAgent]


def place_of(route: str) -> tuple[int, str]:
    """Return where a route stands among others: by number, then what is no number."""
    return (int(route), route) if route.isdecimal() else (2**31, route)


def text_of(results: Results) -> str:
    """Return the compact file, `results.json`: one line for each list of values."""
    agents = {
        name: {
            "called": driven.called,
            "made_of": driven.made_of,
            "versions": driven.versions,
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
    if not isinstance(value, Mapping):
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
