"""From what the official evaluator left of a route to an episode as every other simulator gives it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from pytest_drive_robust.bench2drive.evaluator.drive import DrivenRoute
from pytest_drive_robust.bench2drive.evaluator.setting_json import DT_S
from pytest_drive_robust.bench2drive.results.episode_from_record import episode_of
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Injection, Trace

__all__ = ["episode_result"]


def episode_result(
    driven: DrivenRoute, episode: Episode, *, scenario: str, saved: Path, versions: Mapping[str, str]
) -> EpisodeResult:
    """Return the episode; `infra_error` when no try gave a score. `saved` is where the agent's logs of motion are.

    Raises `UsageError` for a record whose score does not follow from its infractions.
    """
    if driven.record is None:
        return _broken(driven, episode, scenario, versions)
    result = episode_of(driven.record, agent=episode.agent, setting=episode.setting, folders=(saved,))
    return replace(
        result,
        episode=episode,
        scenario=result.scenario or scenario,
        wall_s=driven.wall_s,
        schedule=_schedule(driven.injected),
        inference_s=_inference_s(driven.injected),
        versions=versions,
    )


def _broken(driven: DrivenRoute, episode: Episode, scenario: str, versions: Mapping[str, str]) -> EpisodeResult:
    return EpisodeResult(
        episode=episode,
        scenario=scenario,
        outcome=Outcome.INFRA_ERROR,
        end=End.SIMULATION_CRASHED,
        end_detail="; ".join(driven.troubles) or "stopped",
        route_completion_pct=0.0,
        route_length_m=0.0,
        infractions=(),
        speed_ratios_pct=(),
        ticks=0,
        dt_s=DT_S,
        wall_s=driven.wall_s,
        trace=Trace(np.zeros((0, len(Trace.COLUMNS)))),
        versions=versions,
    )


def _schedule(injected: Mapping[str, object]) -> tuple[Injection, ...]:
    lines = injected.get("schedule")
    return tuple(Injection(*line) for line in lines) if isinstance(lines, list) else ()


def _inference_s(injected: Mapping[str, object]) -> tuple[float, ...]:
    times = injected.get("inference_s")
    return tuple(map(float, times)) if isinstance(times, list) else ()
