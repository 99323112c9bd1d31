"""Builds episode results for tests of everything that reads them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Given, Injection, Reception, Touch, Trace

DT_S = 0.05


def trace_of(ticks: int, **columns: object) -> Trace:
    """Make a trace of `ticks` rows; every column is 0 but the named ones (a number or one number a tick)."""
    rows = np.zeros((ticks, len(Trace.COLUMNS)))
    for name, values in columns.items():
        rows[:, Trace.COLUMNS.index(name)] = values
    return Trace(rows)


def infraction(kind: InfractionKind, *, second: float = 1.0, share_pct: float = 0.0) -> Infraction:
    return Infraction(kind, round(second / DT_S), kind.value, share_pct=share_pct)


def make_result(
    route_id: str = "1",
    *,
    seed: int = 0,
    agent: str = "driver",
    setting: str = "clean",
    scenario: str = "ParkedObstacle",
    end: End = End.COMPLETED,
    outcome: Outcome | None = None,
    end_detail: str = "",
    completion_pct: float = 100.0,
    infractions: Sequence[Infraction | InfractionKind] = (),
    speed_ratios_pct: Sequence[float] = (100.0,),
    trace: Trace | None = None,
    junction_passed: bool = False,
    versions: Mapping[str, str] | None = None,
    dt_s: float = DT_S,
) -> EpisodeResult:
    outcomes = {
        End.COMPLETED: Outcome.COMPLETED,
        End.AGENT_CRASHED: Outcome.AGENT_ERROR,
        End.SIMULATION_CRASHED: Outcome.INFRA_ERROR,
    }
    trace = trace_of(40, speed_mps=5.0) if trace is None else trace
    return EpisodeResult(
        episode=Episode(agent, route_id, setting, seed),
        scenario=scenario,
        outcome=outcomes.get(end, Outcome.FAILED) if outcome is None else outcome,
        end=end,
        end_detail=end_detail or end.value,
        route_completion_pct=completion_pct,
        route_length_m=100.0,
        infractions=tuple(event if isinstance(event, Infraction) else infraction(event) for event in infractions),
        speed_ratios_pct=tuple(speed_ratios_pct),
        ticks=len(trace.rows),
        dt_s=dt_s,
        wall_s=0.1,
        trace=trace,
        junction_passed=junction_passed,
        versions={"embedded": "1"} if versions is None else versions,
    )


def scored(route_id: str, score: float, **given: object) -> EpisodeResult:
    """Make an episode whose driving score is `score`."""
    end = End.COMPLETED if score == 100.0 else End.TICK_CAP
    return make_result(route_id, completion_pct=score, end=given.pop("end", end), **given)  # type: ignore[arg-type]


def crashed_simulation(route_id: str = "1", **given: object) -> EpisodeResult:
    return make_result(route_id, end=End.SIMULATION_CRASHED, end_detail="the server went away", **given)  # type: ignore[arg-type]


FULL = replace(
    make_result(
        "12",
        seed=3,
        setting="GPS noise 5.0 m",
        end=End.BLOCKED,
        completion_pct=100.0 / 3.0,
        infractions=[infraction(InfractionKind.OUTSIDE_LANES, share_pct=12.5), InfractionKind.RED_LIGHT],
        speed_ratios_pct=(0.1 + 0.2, 70.0),
        trace=trace_of(7, x_m=math.pi, speed_mps=float("nan")),
        versions={"embedded": "1", "numba": "0.60"},
    ),
    schedule=(Injection("gps-noise", "gps", 0, 6),),
    inference_s=(0.01, 0.02),
    privileged=True,
    junction_passed=True,
    reception=Reception(("front",), ("cameras", "gps"), 7, (Touch("gps", 7, 0),)),
    given=Given(np.arange(42, dtype=np.float32).reshape(7, 6) / 7),
)
"""A result in which every field has a value of its own."""
