"""One episode among those that are driven in lockstep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import AgentError
from pytest_drive_robust.runner.episode.loop import Drive

if TYPE_CHECKING:
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.perturbations.base import Setting
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["Row", "measures_inference"]


@dataclass(eq=False, slots=True)
class Row:
    """A request under way, and the seconds of wall time that it took so far."""

    request: EpisodeRequest
    drive: Drive
    share_s: float

    def sense(self) -> Observation | None:
        """What the agent is to act on; None when it is not asked, in which case the tick is over."""
        drive = self.drive
        if drive.over:
            return None
        given = drive.attempt(drive.sense)
        if given is None and not drive.over:
            drive.attempt(lambda: drive.advance(None, 0.0))
        return given

    def answer(self, answer: Control | AgentError, inference_s: float) -> None:
        """The rest of the tick, with what the agent said or did wrong."""
        drive = self.drive
        if isinstance(answer, AgentError):
            drive.crash = answer
        else:
            drive.attempt(lambda: drive.advance(answer, inference_s))


def measures_inference(setting: Setting) -> bool:
    """True when the setting needs the seconds that one call of `act` took, which no row of a batch has."""
    return any(bool(getattr(item, "measures_inference", False)) for item in setting.perturbations)
