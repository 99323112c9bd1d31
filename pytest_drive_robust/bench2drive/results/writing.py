"""Write episodes as official records (Bench2Drive `leaderboard/utils/statistics_manager.py`)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from statistics import stdev
from typing import Any

from pytest_drive_robust.bench2drive.results.official_record import EXTENSION, LISTS, lanes_message, speed_message
from pytest_drive_robust.domain.outcome import End, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.score import driving_score, penalty
from pytest_drive_robust.store.episode_fields import fields_of

_SCORES = ("score_composed", "score_route", "score_penalty")
_VALUES = {
    "Collisions with pedestrians": InfractionKind.COLLISION_PEDESTRIAN,
    "Collisions with vehicles": InfractionKind.COLLISION_VEHICLE,
    "Collisions with layout": InfractionKind.COLLISION_LAYOUT,
    "Red lights infractions": InfractionKind.RED_LIGHT,
    "Stop sign infractions": InfractionKind.STOP_SIGN,
    "Off-road infractions": InfractionKind.OUTSIDE_LANES,
    "Route deviations": InfractionKind.DEVIATION,
    "Route timeouts": InfractionKind.ROUTE_TIMEOUT,
    "Agent blocked": InfractionKind.BLOCKED,
    "Yield emergency vehicles infractions": InfractionKind.YIELD_EMERGENCY,
    "Scenario timeouts": InfractionKind.SCENARIO_TIMEOUT,
    "Min speed infractions": InfractionKind.MIN_SPEED,
}


def record_of(result: EpisodeResult, *, index: int, town: str, stamp: str) -> dict[str, Any]:
    """Return the official record of an episode. `stamp` is the time at the end of its save_name, `MM_DD_HH_MM_SS`.

    An `infra_error` becomes a crashed simulation with the score 0, a route that the official evaluator drives again.
    """
    route_id = f"RouteScenario_{result.episode.route_id}_rep{result.episode.seed}"
    scenario = f"{result.scenario}_1"
    infractions = _infractions(result)
    count = sum(map(len, infractions.values()))
    scored = result.outcome is not Outcome.INFRA_ERROR
    return {
        "index": index,
        "route_id": route_id,
        "scenario_name": scenario,
        "weather_id": "0",
        "save_name": re.sub(r"[^A-Za-z0-9.+-]+", "_", f"{route_id}_{town}_{scenario}_0_{stamp}"),
        "status": _status(result, count),
        "num_infractions": count,
        "infractions": infractions,
        "scores": {
            "score_route": round(float(result.route_completion_pct), 6) if scored else 0.0,
            "score_penalty": round(penalty(result), 6) if scored else 0.0,
            "score_composed": driving_score(result) if scored else 0.0,
        },
        "meta": {
            "route_length": round(float(result.route_length_m), 3),
            "duration_game": round(result.game_s, 3),
            "duration_system": round(float(result.wall_s), 3),
        },
        "town_name": town,
        EXTENSION: fields_of(result),
    }


def results_document(records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the document of a whole result file with these records, as of a finished run."""
    scores = {name: [item["scores"][name] for item in records] for name in _SCORES}
    means = {name: round(sum(values) / len(values), 6) for name, values in scores.items()}
    deviations = {name: round(stdev(values), 3) if len(values) > 1 else 0.0 for name, values in scores.items()}
    rates = _events_per_km(records)
    crashed = any(item["status"] == End.SIMULATION_CRASHED.value for item in records)
    return {
        "_checkpoint": {
            "global_record": {
                "index": -1,
                "route_id": -1,
                "status": _worst([item["status"] for item in records]),
                "infractions": rates,
                "scores_mean": means,
                "scores_std_dev": deviations,
                "meta": {
                    "total_length": sum(item["meta"]["route_length"] for item in records),
                    "duration_game": sum(item["meta"]["duration_game"] for item in records),
                    "duration_system": sum(item["meta"]["duration_system"] for item in records),
                    "exceptions": [
                        [item["route_id"], item["index"], item["status"]]
                        for item in records
                        if item["status"].startswith("Failed")
                    ],
                },
            },
            "progress": [len(records), len(records)],
            "records": list(records),
        },
        "entry_status": "Crashed" if crashed else "Finished",
        "eligible": not crashed,
        "sensors": [],
        "values": [*(str(means[name]) for name in _SCORES), *(str(rates[kind.value]) for kind in _VALUES.values())],
        "labels": ["Avg. driving score", "Avg. route completion", "Avg. infraction penalty", *_VALUES],
    }


def _infractions(result: EpisodeResult) -> dict[str, list[str]]:
    lists: dict[str, list[str]] = {name: [] for name in LISTS}
    driven_m = result.route_length_m * result.route_completion_pct / 100.0
    for item in result.infractions:
        if item.kind is InfractionKind.OUTSIDE_LANES:
            lists[item.kind.value].append(lanes_message(item.share_pct, driven_m))
        elif item.kind is not InfractionKind.MIN_SPEED:
            lists[item.kind.value].append(f"{item.detail} at (x={item.x_m:.3f}, y={item.y_m:.3f}, z=0.000)")
    # One sentence for each twentieth of the route, good or bad: the official efficiency is computed from these alone.
    lists[InfractionKind.MIN_SPEED.value] = [speed_message(ratio) for ratio in result.speed_ratios_pct]
    return lists


def _status(result: EpisodeResult, messages: int) -> str:
    """Return the official status; an early stop and an end by a gymnasium environment keep our own status."""
    if result.outcome is Outcome.COMPLETED:
        return "Completed" if messages else "Perfect"
    if result.outcome is Outcome.AGENT_ERROR:
        return End.AGENT_CRASHED.value
    if result.outcome is Outcome.INFRA_ERROR:
        return End.SIMULATION_CRASHED.value
    return result.end.value


def _worst(statuses: Sequence[str]) -> str:
    if any(status.startswith("Failed") for status in statuses):
        return "Failed"
    return "Perfect" if all(status == "Perfect" for status in statuses) else "Completed"


def _events_per_km(records: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return events per driven kilometre by list; for the lanes, the kilometres outside of them, from the sentences."""
    driven_km = sum(item["meta"]["route_length"] / 1000.0 * item["scores"]["score_route"] / 100.0 for item in records)
    rates = {name: sum(len(item["infractions"][name]) for item in records) / max(driven_km, 0.001) for name in LISTS}
    lanes = InfractionKind.OUTSIDE_LANES.value
    sentences = [item["infractions"][lanes][0] for item in records if item["infractions"][lanes]]
    rates[lanes] = sum(float(sentence.split(" ")[8]) / 1000.0 for sentence in sentences)
    return {name: round(rate, 3) for name, rate in rates.items()}
