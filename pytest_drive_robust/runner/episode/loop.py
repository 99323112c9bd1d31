"""The closed loop: one agent drives one episode, and every end of the episode becomes an `EpisodeResult`."""

from __future__ import annotations

import copy
import time
from array import array
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Injection, Trace, read_only
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.domain.truth import GroundTruth, LaneMap, WorldState
from pytest_drive_robust.errors import AgentError, PerturbationError, SimulationError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.perturbations.stack import RunningStack
from pytest_drive_robust.runner.episode.contract import (
    agent_act,
    agent_cameras,
    agent_consumes,
    agent_privileged,
    agent_reset,
    blame,
)
from pytest_drive_robust.runner.episode.surroundings import EVERY_TICKS, Surroundings
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.runner.episode.witness import Witness
from pytest_drive_robust.runner.episode.world_contract import (
    stack_schedule,
    world_dt_s,
    world_ends,
    world_observation,
    world_reset,
    world_score,
    world_step,
)
from pytest_drive_robust.simulators.base import EpisodeScore, Simulator

_Given = TypeVar("_Given")
_OUTCOMES = {
    End.COMPLETED: Outcome.COMPLETED,
    End.AGENT_CRASHED: Outcome.AGENT_ERROR,
    End.SIMULATION_CRASHED: Outcome.INFRA_ERROR,
}  # every other end is the agent's failure
_WORLD, _PERTURBATION = "the simulation", "a perturbation"
USUAL_DT_S = 0.05
"""The length of a tick in seconds in results of episodes whose world never told its own."""


def drive_episode(
    simulator: Simulator,
    agent: Agent,
    *,
    route: Route,
    setting: Setting,
    seed: int,
    agent_name: str,
    watch: Watch | None = None,
) -> EpisodeResult:
    """Drive one episode to its end and return its result.

    A fault of the agent (exception, `sys.exit`, NaN, wrong type, bad cameras) ends the episode in `agent_error`, and
    the ticks so far are scored. A fault of the simulator or of a perturbation ends the episode in `infra_error`, which
    is never scored. Neither raises; KeyboardInterrupt goes through to the caller. During the warm-up of the setting the
    vehicle gets `Control.NEUTRAL`, whatever the agent answers.
    """
    running = RunningEpisode(simulator, agent, route, setting, seed, watch=watch)
    running.drive()
    return running.result(Episode(agent_name, route.id, str(setting), seed))


class RunningEpisode:
    """Drives an episode in steps, so that other episodes can be driven beside it; keeps its records and its error.

    Call `start`, then `tick` until `over`, then `result`. `tick` is `sense` and, when that returns an observation,
    `ask` and `advance`. Call each step through `attempt`, which keeps an error as `crash`. `drive` does all but
    `result`.

    `view` is a camera for the film, mounted when the agent has none; its images are only in `images`. `share_s` is the
    episode's share of the wall seconds of a batch.
    """

    def __init__(
        self,
        simulator: Simulator,
        agent: Agent,
        route: Route,
        setting: Setting,
        seed: int,
        *,
        watch: Watch | None = None,
        view: CameraSpec | None = None,
    ) -> None:
        self.simulator = simulator
        self.agent = agent
        self.route = route
        self.setting = setting
        self.seed = seed
        self.privileged = False
        self.shows_view = False
        self.plan: GlobalPlan | None = None
        self.warmup_ticks = 0
        self.dt_s = USUAL_DT_S  # until `start` has asked the world
        self.started_s = time.perf_counter()
        self.share_s = 0.0
        self.ticks = 0
        self.surroundings = Surroundings()
        self.witness = Witness()
        self.crash: AgentError | SimulationError | None = None
        self.stack: RunningStack | None = None
        self.state: WorldState | None = None
        self.images: Mapping[str, Image] = {}
        self._watch = watch or Watch()
        self._view = () if view is None else (view,)
        self._mounted: dict[str, CameraSpec] = {}  # the cameras that the world was given, by name
        self._seen: Observation | None = None
        self._lane_map: LaneMap | None = None  # the agent's own copy
        self._rows = array("d")  # the rows of a `Trace`, one after the other
        self._done = False
        self._whose = _WORLD  # code runs, when it is not the agent's

    @property
    def over(self) -> bool:
        """True when the episode has ended."""
        return self._done or self.crash is not None

    def attempt(self, action: Callable[[], _Given]) -> _Given | None:
        """Return the result of `action`; when it raises, end the episode, blame the right code, and return None."""
        try:
            return action()
        except (AgentError, SimulationError) as error:
            self.fail(error)
        except PerturbationError as error:  # its message already names the call
            self.fail(SimulationError(str(error)))
        except Exception as error:
            self.fail(SimulationError(blame(self._whose, error)))
        return None

    def fail(self, error: AgentError | SimulationError) -> None:
        """End the episode with this error."""
        self.crash = error
        self._watch.failed(error)

    def drive(self) -> None:
        """Start the episode and drive it to its end; see `drive_episode`."""
        self.attempt(self.start)
        while not self.over:
            self.attempt(self.tick)

    def start(self) -> None:
        """Build the world, then reset the agent and the perturbations."""
        self.dt_s = world_dt_s(self.simulator)
        self._enter("reset")
        self.privileged = agent_privileged(self.agent)
        cameras = agent_cameras(self.agent, self.dt_s)
        consumes = agent_consumes(self.agent)
        self._watch.equip(cameras, consumes, privileged=self.privileged)
        self.witness = Witness(tuple(camera.name for camera in cameras), consumes)
        self.shows_view = bool(self._view) and not cameras
        self._enter("sim")
        self._mounted = {camera.name: camera for camera in cameras or self._view}
        self.state = world_reset(self.simulator, self.route, self.seed, cameras or self._view)
        self.plan = self.simulator.plan()
        self._enter("reset")
        agent_reset(self.agent, self.plan, self.seed)
        self._enter("sim")
        self._whose = _PERTURBATION
        self.stack = RunningStack.of(
            self.setting, route_id=self.route.id, seed=self.seed, dt_s=self.dt_s, cameras=cameras
        )
        self.warmup_ticks = self.setting.warmup_ticks
        self._whose = _WORLD
        self._done = world_ends(self.simulator)

    def tick(self) -> None:
        """Observe, ask the agent when its computer is free, step the world."""
        given = self.sense()
        if given is not None:
            self.advance(*self.ask(given))

    def sense(self) -> Observation | None:
        """Return the agent's own copy of the perturbed observation.

        Returns None when the agent's computer is busy: the tick is over then.
        """
        stack = self.stack
        assert stack is not None  # start() came before
        captured = world_observation(self.simulator, self._mounted)
        if stack.observes:  # a slow camera's image is given again: writes to it would add up
            captured = captured.map_images(lambda name, image: image.read_only())
        self.images = captured.cameras
        if self.shows_view:
            captured = replace(captured, cameras={})
        self._whose = _PERTURBATION
        self._seen = observation = stack.observe(captured)
        wanted = stack.wants_inference(self.ticks)
        self._whose = _WORLD
        if not wanted:
            self.advance(None, 0.0)
            return None
        self.witness.seen(captured, observation)
        given, truth = observation.private(), self._truth() if self.privileged else None
        return given if given.truth is truth else replace(given, truth=truth)

    def _truth(self) -> GroundTruth:
        """Return the ground truth for a privileged agent, in its own memory: worlds share the map of a town."""
        truth = self.simulator.truth().private()
        if self._lane_map is None:
            self._lane_map = copy.deepcopy(truth.lane_map)
        return replace(truth, lane_map=self._lane_map)

    def ask(self, given: Observation) -> tuple[Control, float]:
        """Return the agent's control for the observation `given`, and the seconds of the call."""
        self._enter("act")
        asked_s = time.perf_counter()
        control = agent_act(self.agent, given)
        inference_s = time.perf_counter() - asked_s
        self._enter("sim")
        return control, inference_s

    def advance(self, control: Control | AgentError | None, inference_s: float) -> None:
        """Step the world. `control` is the agent's answer to the observation of `sense`, None when it was not asked."""
        if isinstance(control, AgentError):
            raise control
        tick, state, stack, observation = self.ticks, self.state, self.stack, self._seen
        assert state is not None  # start() and sense() came before
        assert stack is not None
        assert observation is not None
        if tick % EVERY_TICKS == 0:
            self.surroundings.see(state)
        if control is not None and tick >= self.surroundings.next_plan:
            self._enter("act")
            self.surroundings.see_plan(tick, self.agent)
            self._enter("sim")
        self._whose = _PERTURBATION
        applied = stack.actuate(tick, control, inference_s)
        self._whose = _WORLD
        if not isinstance(applied, Control):
            raise SimulationError(f"the perturbations gave the vehicle {applied!r}, expected a Control or None")
        if applied is not control and (problem := applied.problem()) is not None:
            raise SimulationError(f"the perturbations gave the vehicle {applied!r}: {problem}")
        if tick < self.warmup_ticks:
            applied = Control.NEUTRAL  # the clean twin waits as long: not counted as a change by the setting
        else:
            self.witness.applied(tick, control, applied)
        self.state = after = world_step(self.simulator, applied)
        ego = after.ego
        self._rows.extend((ego.x_m, ego.y_m, ego.yaw_rad, ego.speed_mps, ego.forward_mps2, ego.right_mps2))
        self._rows.extend((ego.yaw_rate_radps, applied.throttle, applied.steer, applied.brake))
        self._rows.append(self.simulator.progress_m)
        self.ticks += 1
        self._watch.ticked(tick, state, observation, control, applied)
        self._done = world_ends(self.simulator)

    def result(self, episode: Episode) -> EpisodeResult:
        """Return the result of the episode; an `infra_error` when the world cannot report its score."""
        score: EpisodeScore | None = None
        schedule: tuple[Injection, ...] = ()
        versions: dict[str, str] = {}
        trace = self._trace()
        try:
            self._enter("sim")
            if self.state is not None and not isinstance(self.crash, SimulationError):
                score = world_score(self.simulator)
                if (problem := trace.problem()) is not None:
                    raise SimulationError(f"the world's {problem}")
            if self.stack is not None:
                schedule = stack_schedule(self.stack)
            versions = {str(name): str(version) for name, version in self.simulator.versions().items()}
        except SimulationError as error:
            self.crash, score = error, None
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
            ticks=self.ticks,
            dt_s=self.dt_s,
            wall_s=self.share_s or time.perf_counter() - self.started_s,
            trace=trace,
            schedule=schedule,
            inference_s=tuple(self.stack.inference_s) if self.stack is not None else (),
            privileged=self.privileged,
            junction_passed=score.junction_passed if score else False,
            versions=versions,
            reception=self.witness.reception(),
            given=self.witness.given(),
            tracks=self.surroundings.tracks(),
        )

    def _enter(self, phase: str) -> None:
        self._watch.phase(phase, self.ticks)

    def _trace(self) -> Trace:
        """Return the trace recorded so far, in its own memory."""
        width = len(Trace.COLUMNS)
        rows = np.array(self._rows[: self.ticks * width], dtype=np.float64).reshape(-1, width)
        return Trace(read_only(rows.copy()))

    def _end(self, score: EpisodeScore | None) -> tuple[End, str]:
        if isinstance(self.crash, AgentError):
            return End.AGENT_CRASHED, str(self.crash)
        if self.crash is not None or score is None:
            return End.SIMULATION_CRASHED, str(self.crash)
        return score.end, score.end_detail
