"""The result of an episode of which only the end is known."""

from __future__ import annotations

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.runner.episode.loop import USUAL_DT_S
from pytest_drive_robust.store.episode_fields import NO_TICKS


def bare_result(route: Route, episode: Episode, *, outcome: Outcome, end: End, detail: str) -> EpisodeResult:
    """Return the result of an episode of which only the end is known: no ticks, no scores."""
    return EpisodeResult(
        episode=episode,
        scenario=route.scenario.type,
        outcome=outcome,
        end=end,
        end_detail=detail,
        route_completion_pct=0.0,
        route_length_m=0.0,
        infractions=(),
        speed_ratios_pct=(),
        ticks=0,
        dt_s=USUAL_DT_S,
        wall_s=0.0,
        trace=NO_TICKS,
    )
