"""Drives the recorded ticks of an episode again whose process ended, so that the episode gets a score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.runner.episode.loop import RunningEpisode
from pytest_drive_robust.runner.episode.stored_controls import StoredControls
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import Simulator


@dataclass(frozen=True, slots=True)
class RecordedTicks:
    """The known part of an episode whose process ended: the agent's declarations and the controls of driven ticks.

    `asked` holds the agent's answers, None for a tick in which the agent was not asked; `applied` holds the controls
    that the vehicle got.
    """

    cameras: tuple[CameraSpec, ...]
    consumes: tuple[str, ...]
    privileged: bool
    asked: tuple[Control | None, ...]
    applied: tuple[Control, ...]


@dataclass
class _AsApplied(Perturbation):
    """Repeats recorded ticks: asks the agent in the same ticks, and gives the vehicle the recorded controls."""

    asked: Sequence[Control | None]
    applied: Sequence[Control]

    def wants_inference(self, tick: int) -> bool:
        return tick >= len(self.asked) or self.asked[tick] is not None

    def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control:
        return self.applied[tick]


def drive_again(simulator: Simulator, recorded: RecordedTicks, request: EpisodeRequest) -> EpisodeResult:
    """Return the result of the recorded ticks, as if the agent had raised an error after them.

    The perturbations get the same observations and controls as before, so their schedule comes out, too. The world
    repeats its way even when the wall clock decided what the setting did.
    """
    controls = [control for control in recorded.asked if control is not None]
    agent = StoredControls(controls, cameras=recorded.cameras, consumes=recorded.consumes)
    as_applied = Setting((*request.setting.perturbations, _AsApplied(recorded.asked, recorded.applied)))
    running = RunningEpisode(simulator, agent, request.route, as_applied, request.episode.seed)
    running.drive()
    return replace(running.result(request.episode), privileged=recorded.privileged)
