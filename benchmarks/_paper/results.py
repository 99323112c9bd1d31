"""Driven episodes as this benchmark keeps them: score, success and efficiency of every agent, setting and route.

A setting is called as the report calls it, so that `200 ms latency (reading=released)` is another one than without
the brackets; `readings.py` says which of them stand in the table. Nothing is filled in: an agent or a setting that was
not driven is missing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["FORMAT", "DrivenAgent", "Results", "Scores", "results_of", "text_of"]

FORMAT = "drive-robust paper table 2"
"""What the compact file says it is. The first one had one reading and no comfort."""


@dataclass(frozen=True, slots=True)
class Scores:
    """One agent under one setting; one value for each route, in the order of `Results.routes`.

    `driving_score` is 0..100; `efficiency` percent of the traffic's speed, None on a route without data; `comfort`
    percent of the segments, the mean over the routes that have data, because a report has it of no single route.
    """

    driving_score: tuple[float, ...]
    success: tuple[bool, ...]
    efficiency: tuple[float | None, ...]
    comfort: float | None


@dataclass(frozen=True, slots=True)
class DrivenAgent:
    """Everything that one agent drove, by setting. `called` is its name with its options, `simlingo:tuning=published`.

    `made_of` identifies its code and weights, `versions` what it ran on.
    """

    called: str
    made_of: Mapping[str, str]
    versions: Mapping[str, str]
    settings: Mapping[str, Scores]


@dataclass(frozen=True, slots=True)
class Results:
    """`routes` maps each route id to its scenario type and the digest of its definition.

    `world` is what all agents must share: simulator with its version, seed, when a standing car is stopped.
    """

    world: Mapping[str, object]
    routes: Mapping[str, tuple[str, str]]
    agents: Mapping[str, DrivenAgent]


def text_of(results: Results) -> str:
    """Return the compact file, `results.json`: one line for each list of values."""
    agents = {
        name: {
            "called": driven.called,
            "made_of": driven.made_of,
            "versions": driven.versions,
            "settings": {
                setting: {
                    "driving_score": scores.driving_score,
                    "success": [int(value) for value in scores.success],
                    "efficiency": scores.efficiency,
                    "comfort": scores.comfort,
                }
                for setting, scores in driven.settings.items()
            },
        }
        for name, driven in results.agents.items()
    }
    document = {"format": FORMAT, "world": results.world, "routes": results.routes, "agents": agents}
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
                setting: Scores(
                    tuple(lists["driving_score"]),
                    tuple(map(bool, lists["success"])),
                    tuple(lists["efficiency"]),
                    lists["comfort"],
                )
                for setting, lists in driven["settings"].items()
            },
        )
        for name, driven in document["agents"].items()
    }
    routes = {route: (facts[0], facts[1]) for route, facts in document["routes"].items()}
    return Results(document["world"], routes, agents)
