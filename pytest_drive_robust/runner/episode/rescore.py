"""The score of an episode whose process died: the recorded controls are driven again, without the agent."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Trace
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.stored_controls import AgentRig, StoredControls

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.simulators.base import Simulator

__all__ = ["ROW_FIELDS", "RecordedControls", "bare_result", "drive_again"]

ROW_FIELDS = 9
"""A row a tick: throttle, steer, brake as asked (NaN: not asked), the same as applied, x, y, speed before the tick."""
_ASKED = slice(0, 3)
_APPLIED = slice(3, 6)
_POSE = slice(6, 9)


@dataclass(frozen=True, slots=True)
class RecordedControls:
    """What is known of an episode whose process ended.

    `rig` is None when it never came to that; `rows` are those of every tick (see `ROW_FIELDS`).
    `call` is where the agent was lost: `"sensors"`, `"reset"` or `"act"`.
    """

    rig: AgentRig | None
    rows: NDArray[np.float64]
    call: str


def drive_again(
    simulator: Simulator, recorded: RecordedControls, *, route: Route, setting: Setting, episode: Episode
) -> EpisodeResult:
    """Drive the episode up to where the agent was lost, as if the agent had raised there.

    First what the agent asked for is driven through the setting, which gives the schedule too. Where that leads
    elsewhere, because the wall clock decided what the setting did, what the vehicle got is driven in a clean world.
    """
    through = _drive_recorded(simulator, recorded, route, setting, episode.seed, as_applied=False)
    if _same_way(through, recorded):
        return replace(through, episode=episode)
    direct = _drive_recorded(simulator, recorded, route, Setting.CLEAN, episode.seed, as_applied=True)
    if direct.outcome is Outcome.INFRA_ERROR:
        direct = through
    return replace(direct, episode=episode, schedule=through.schedule, reception=through.reception)


def bare_result(
    route: Route, episode: Episode, *, outcome: Outcome, end: End, detail: str, dt_s: float = 0.05
) -> EpisodeResult:
    """Return the result of an episode of which nothing but its end is known."""
    import numpy as np

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
        dt_s=dt_s,
        wall_s=0.0,
        trace=Trace(np.zeros((0, len(Trace.COLUMNS)))),
    )


def _drive_recorded(
    simulator: Simulator, recorded: RecordedControls, route: Route, setting: Setting, seed: int, *, as_applied: bool
) -> EpisodeResult:
    rows = recorded.rows[:, _APPLIED if as_applied else _ASKED]
    controls = [Control(*row) for row in rows.tolist() if row[0] == row[0]]  # NaN is not itself
    agent = StoredControls(controls, rig=recorded.rig, lost_in=recorded.call)
    result = drive_episode(simulator, agent, route=route, setting=setting, seed=seed, agent_name="nobody")
    return replace(result, privileged=recorded.rig is not None and recorded.rig.privileged)


def _same_way(result: EpisodeResult, recorded: RecordedControls) -> bool:
    """Return whether the world went the recorded way: the pose after each tick is the pose before the next."""
    names = ("x_m", "y_m", "speed_mps")
    if result.outcome is Outcome.INFRA_ERROR or result.ticks != len(recorded.rows):
        return False
    return all(
        bool((result.trace.column(name)[:-1] == recorded.rows[1:, _POSE][:, number]).all())
        for number, name in enumerate(names)
    )
