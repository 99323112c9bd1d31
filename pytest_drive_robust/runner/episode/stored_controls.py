"""Drives without an agent: repeats the controls of an earlier drive.

An agent's controls may depend on the processor, the world does not. So the trajectory repeats to the last bit on any
machine, and an episode whose process died gets a score.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.runner.episode.loop import USUAL_DT_S, RunningEpisode
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import Simulator
from pytest_drive_robust.store.episode_fields import NO_TICKS


class StoredControls:
    """An agent that returns given controls, one in each call of `act`, then raises `IndexError`."""

    portable_bits = True

    def __init__(
        self,
        controls: Iterable[Control],
        *,
        cameras: Sequence[CameraSpec] = (),
        consumes: Iterable[str] = (),
        told: str = "",
    ) -> None:
        self.consumes = frozenset(consumes)
        self._cameras = cameras
        self._controls = iter(controls)
        self._told = told

    @classmethod
    def of(cls, stored: EpisodeResult) -> StoredControls:
        """Return an agent that repeats the controls that the vehicle got in each tick of `stored`.

        Drive it under `clean`: the controls already contain the effect of the setting.
        """
        rows = zip(*(values.tolist() for values in stored.trace.columns("throttle", "steer", "brake")), strict=True)
        return cls((Control(*row) for row in rows), told=f": {stored.outcome.value}, {stored.end_detail}")

    def sensors(self) -> Sequence[CameraSpec]:
        """Return the cameras given to the constructor."""
        return self._cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Do nothing: the controls begin with the first tick."""

    def act(self, observation: Observation) -> Control:
        """Return the next control."""
        control = next(self._controls, None)
        if control is None:
            raise IndexError(f"the stored episode ended here{self._told}")
        return control


@dataclass(frozen=True, slots=True)
class RecordedControls:
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


def drive_again(simulator: Simulator, recorded: RecordedControls, request: EpisodeRequest) -> EpisodeResult:
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
