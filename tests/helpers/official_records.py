"""Synthetic official records, and the official totals computed a second time from their description."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

LISTS = (
    "collisions_layout",
    "collisions_pedestrian",
    "collisions_vehicle",
    "red_light",
    "stop_infraction",
    "outside_route_lanes",
    "min_speed_infractions",
    "yield_emergency_vehicle_infractions",
    "scenario_timeouts",
    "route_dev",
    "vehicle_blocked",
    "route_timeout",
)
FACTORS = {
    "collisions_layout": 0.65,
    "collisions_pedestrian": 0.5,
    "collisions_vehicle": 0.6,
    "red_light": 0.7,
    "stop_infraction": 0.8,
    "yield_emergency_vehicle_infractions": 0.7,
    "scenario_timeouts": 0.7,
}


def speed(ratio: object) -> str:
    return f"Average speed is {ratio}% of the surrounding traffic's one"


def lanes(share: float) -> str:
    return f"Agent went outside its route lanes for about 4.0 meters ({share}% of the completed route)"


def record(
    route: str = "101",
    *,
    repetition: int = 0,
    scenario: str = "ParkedObstacle",
    status: str = "Completed",
    completion: float = 100.0,
    share: float | None = None,
    ratios: Sequence[object] = (80.0, 120.5),
    game_s: float = 42.0,
    wall_s: float = 300.25,
    **events: int,
) -> dict[str, Any]:
    """Make a record; `share` is the exact percentage outside of the lanes, which the sentence rounds."""
    infractions: dict[str, list[str]] = {name: [] for name in LISTS}
    factor = 1.0
    for name, count in events.items():
        infractions[name] = [f"Agent collided at (x=1.5, y=-2.25, z=0.1), number {n}" for n in range(count)]
        factor *= FACTORS.get(name, 1.0) ** count
    if share is not None:
        infractions["outside_route_lanes"] = [lanes(round(share, 2))]
        factor *= 1.0 - share / 100.0
    infractions["min_speed_infractions"] = [speed(ratio) for ratio in ratios]
    return {
        "index": 0,
        "route_id": f"RouteScenario_{route}_rep{repetition}",
        "scenario_name": f"{scenario}_1",
        "weather_id": "3",
        "save_name": f"RouteScenario_{route}_rep{repetition}_Town12_{scenario}_1_3_01_02_03_04_05",
        "town_name": "Town12",
        "status": status,
        "num_infractions": sum(map(len, infractions.values())),
        "infractions": infractions,
        "scores": {
            "score_route": completion,
            "score_penalty": round(factor, 6),
            "score_composed": round(completion * factor, 6),
        },
        "meta": {"route_length": 120.5, "duration_game": game_s, "duration_system": wall_s},
    }


def document(*records: Mapping[str, Any], planned: int | None = None) -> dict[str, Any]:
    progress = [] if planned is None else [len(records), planned]
    return {"_checkpoint": {"records": list(records), "progress": progress}, "entry_status": "Finished"}


def write(path: Path, content: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def motion_step(
    *, forward: float = 0.0, right: float = 0.0, turn_degps: float = 0.0, x_m: float = 0.0
) -> dict[str, Any]:
    """Return a car that looks along x."""
    return {
        "acceleration": [forward, right, 0.1],
        "angular_velocity": [0.0, 0.0, turn_degps],
        "forward_vector": [1.0, 0.0, 0.0],
        "right_vector": [0.0, 1.0, 0.0],
        "location": [x_m, 0.0, 0.2],
        "rotation": [0.0, 0.0, 0.0],
    }


def official_totals(records: Sequence[Mapping[str, Any]]) -> tuple[float, float, float | None]:
    """Return DS, SR and efficiency; None where the official tool divides by zero."""
    successes = sum(
        item["status"] in ("Completed", "Perfect")
        and not any(found for name, found in item["infractions"].items() if name != "min_speed_infractions")
        for item in records
    )
    by_record = []
    for item in records:
        sentences = item["infractions"]["min_speed_infractions"]
        values = [float(re.findall(r"\b\d+\.?\d*%", text)[0][:-1]) for text in sentences]
        kept = [value for value in values if not value > 1000]
        if kept:
            by_record.append(sum(kept) / len(kept))
    efficiency = sum(by_record) / len(by_record) if by_record else None
    return sum(item["scores"]["score_composed"] for item in records) / 220, successes / 220, efficiency
