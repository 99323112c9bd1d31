"""The closed loop: one agent drives one episode, and every end of it becomes an `EpisodeResult`."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from pytest_drive_robust.domain.agent import is_privileged
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import AgentError, SimulationError
from pytest_drive_robust.runner.contract import agent_act, agent_cameras, agent_consumes, agent_reset, blame
from pytest_drive_robust.runner.recorder import Recorder
from pytest_drive_robust.runner.witness import Witness

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.observation import Observation
    from pytest_drive_robust.domain.result import Injection
    from pytest_drive_robust.domain.route import Route
    from pytest_drive_robust.domain.truth import Frame, GroundTruth
    from pytest_drive_robust.perturbations.running import RunningStack
    from pytest_drive_robust.perturbations.setting import Setting
    from pytest_drive_robust.simulators.base import Score, Simulator

    OnTick = Callable[[int, Frame, Observation, Control], object]

__all__ = ["drive_episode"]

_OUTCOMES = {
    End.COMPLETED: Outcome.COMPLETED,
    End.AGENT_CRASHED: Outcome.AGENT_ERROR,
    End.SIMULATION_CRASHED: Outcome.INFRA_ERROR,
}  # every other end is the agent's failure


def drive_episode(
    simulator: Simulator,
    agent: Agent,
    *,
    route: Route,
    setting: Setting,
    seed: int,
    agent_name: str,
    on_tick: OnTick | None = None,
) -> EpisodeResult:
    """Drive one episode to its end. Never raises for what the agent, the simulator or a perturbation does.

    What the agent does wrong (exception, `sys.exit`, NaN, wrong type, bad cameras) ends in `agent_error`, with what
    was driven so far scored. What the simulator or a perturbation does wrong ends in `infra_error`, never scored.
    KeyboardInterrupt, and whatever `on_tick` raises, goes through to the caller.

    While the warm-up of the setting lasts the vehicle gets `Control.NEUTRAL`, whatever the agent says.

    `on_tick(tick, frame, observation, control)` is called after every tick with the world at the moment of the
    observation, the observation as perturbed (not the agent's own copy of it), and the control that the vehicle got.
    """
    drive = _Drive(simulator, agent, route, setting, seed)
    drive.attempt(drive.start)
    while not drive.over:
        drive.attempt(drive.tick)
        if on_tick is not None and drive.moment is not None:
            on_tick(*drive.moment)
    return drive.result(Episode(agent_name, route.id, str(setting), seed))


class _Drive:
    """An episode under way: whose fault its end is, and what was recorded until then."""

    def __init__(self, simulator: Simulator, agent: Agent, route: Route, setting: Setting, seed: int) -> None:
        self.simulator = simulator
        self.agent = agent
        self.route = route
        self.setting = setting
        self.seed = seed
        self.privileged = False
        self.warmup_ticks = 0
        self.started_s = time.perf_counter()
        self.recorder = Recorder()
        self.witness = Witness()
        self.crash: AgentError | SimulationError | None = None
        self.moment: tuple[int, Frame, Observation, Control] | None = None
        self.stack: RunningStack | None = None
        self._frame: Frame | None = None
        self._done = False

    @property
    def over(self) -> bool:
        """True once nothing more can be driven."""
        return self._done or self.crash is not None

    def attempt(self, action: Callable[[], None]) -> None:
        """Do one thing and remember whose fault it is when it fails."""
        self.moment = None
        try:
            action()
        except AgentError as error:
            self.crash = error
        except SimulationError as error:
            self.crash = error
        except Exception as error:
            self.crash = SimulationError(blame("the simulation", error))

    def start(self) -> None:
        """Build the world, then wake up the agent and the perturbations."""
        self.privileged = is_privileged(self.agent)
        cameras = agent_cameras(self.agent, self.simulator.dt_s)
        self.witness = Witness(tuple(camera.name for camera in cameras), agent_consumes(self.agent))
        self._frame = self.simulator.reset(self.route, seed=self.seed, cameras=cameras)
        agent_reset(self.agent, self.simulator.plan(), self.seed)
        self.stack = self.setting.start(
            route_id=self.route.id, seed=self.seed, dt_s=self.simulator.dt_s, cameras=cameras
        )
        self.warmup_ticks = self.stack.warmup_ticks
        self._done = self.simulator.done is not None

    def tick(self) -> None:
        """Observe, ask the agent when its computer is free, step the world."""
        tick, frame, stack = self.recorder.ticks, self._frame, self.stack
        assert frame is not None  # start() came before
        assert stack is not None
        captured = self.simulator.observe()
        observation = stack.observe(captured)
        control, inference_s = None, 0.0
        if stack.wants_inference(tick):
            self.witness.seen(captured, observation)
            given = replace(observation.private(), truth=_private(self.simulator.truth()) if self.privileged else None)
            asked_s = time.perf_counter()
            control = agent_act(self.agent, given)
            inference_s = time.perf_counter() - asked_s
        applied = stack.actuate(tick, control, inference_s)
        if applied is not control and (problem := applied.problem()) is not None:
            raise SimulationError(f"the perturbations gave the vehicle {applied!r}: {problem}")
        if tick < self.warmup_ticks:
            applied = Control.NEUTRAL  # the clean twin waits as long: no part of what the setting changes
        else:
            self.witness.applied(tick, control, applied)
        self._frame = self.simulator.step(applied)
        self.recorder.add(self._frame.ego, applied, self.simulator.progress_m)
        self.moment = (tick, frame, observation, applied)
        self._done = self.simulator.done is not None

    def result(self, episode: Episode) -> EpisodeResult:
        """Close the books. A world that cannot even report its score makes the episode an `infra_error`."""
        score: Score | None = None
        schedule: tuple[Injection, ...] = ()
        versions: dict[str, str] = {}
        try:
            if self._frame is not None and not isinstance(self.crash, SimulationError):
                score = self.simulator.score()
            schedule = self.stack.schedule() if self.stack is not None else ()
            versions = dict(self.simulator.versions())
        except Exception as error:
            self.crash, score = SimulationError(blame("the end of the simulation", error)), None
        end, detail = self._end(score)
        return EpisodeResult(
            episode=episode,
            scenario=self.route.scenario.type,
            outcome=_OUTCOMES.get(end, Outcome.FAILED),
            end=end,
            end_detail=detail,
            route_completion_pct=score.route_completion_pct if score else 0.0,
            route_length_m=score.route_length_m if score else 0.0,
            infractions=score.infractions if score else (),
            speed_ratios_pct=score.speed_ratios_pct if score else (),
            ticks=self.recorder.ticks,
            dt_s=self.simulator.dt_s,
            wall_s=time.perf_counter() - self.started_s,
            trace=self.recorder.trace(),
            schedule=schedule,
            inference_s=tuple(self.stack.inference_s) if self.stack is not None else (),
            privileged=self.privileged,
            junction_passed=score.junction_passed if score else False,
            versions=versions,
            reception=self.witness.reception(),
        )

    def _end(self, score: Score | None) -> tuple[End, str]:
        if isinstance(self.crash, AgentError):
            return End.AGENT_CRASHED, str(self.crash)
        if self.crash is not None or score is None:
            return End.SIMULATION_CRASHED, str(self.crash)
        return score.end, score.end_detail


def _private(truth: GroundTruth) -> GroundTruth:
    """The truth of this moment in arrays of its own. The lane map is static and stays shared: read it only."""
    frame = replace(truth.frame, actors=truth.frame.actors.copy(), lights=truth.frame.lights.copy())
    return replace(truth, frame=frame, route=truth.route.copy())
