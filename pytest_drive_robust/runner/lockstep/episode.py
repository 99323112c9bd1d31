"""One episode among those that are driven in lockstep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.loop import RunningEpisode

if TYPE_CHECKING:
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.perturbations.base import Setting
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["LockstepEpisode", "measures_inference"]


@dataclass(eq=False, slots=True)
class LockstepEpisode:
    """A request under way, and the seconds of wall time that it took so far."""

    request: EpisodeRequest
    running: RunningEpisode
    share_s: float

    def sense(self) -> Observation | None:
        """Return what the agent is to act on; None when it is not asked, in which case the tick is over."""
        running = self.running
        if running.over:
            return None
        given = running.attempt(running.sense)
        if given is None and not running.over:
            running.attempt(lambda: running.advance(None, 0.0))
        return given

    def answer(self, answer: Control | AgentError, inference_s: float) -> None:
        """Drive the rest of the tick with what the agent answered or did wrong."""
        running = self.running
        if isinstance(answer, AgentError):
            running.crash = answer
        else:
            running.attempt(lambda: running.advance(answer, inference_s))


def measures_inference(setting: Setting) -> bool:
    """Return whether the setting needs the seconds that one call of `act` took, which no row of a batch has."""
    return any(bool(getattr(item, "measures_inference", False)) for item in setting.perturbations)
