"""The closed loop: one agent drives one episode, and every end of the episode becomes an `EpisodeResult`."""

from __future__ import annotations

import copy
import math
import time
from array import array
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import TypeVar

import numpy as np

from pytest_drive_robust.domain.agent import Agent
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Injection, Trace, read_only
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.domain.truth import GroundTruth, LaneMap, WorldState
from pytest_drive_robust.errors import AgentError, PerturbationError, SimulationError
from pytest_drive_robust.perturbations.base import RunningStack, Setting
from pytest_drive_robust.runner.episode.contract import (
    agent_act,
    agent_cameras,
    agent_consumes,
    agent_privileged,
    agent_reset,
    blame,
)
from pytest_drive_robust.runner.episode.surroundings import EVERY_TICKS, Surroundings
from pytest_drive_robust.runner.episode.witness import Witness
from pytest_drive_robust.simulators.base import EpisodeScore, Simulator
from pytest_drive_robust.store.episode_fields import unstorable

_Given = TypeVar("_Given")
_OUTCOMES = {
    End.COMPLETED: Outcome.COMPLETED,
    End.AGENT_CRASHED: Outcome.AGENT_ERROR,
    End.SIMULATION_CRASHED: Outcome.INFRA_ERROR,
}  # every other end is the agent's failure
_WORLD, _PERTURBATION = "the simulation", "a perturbation"
USUAL_DT_S = 0.05
"""The length of a tick in seconds in results of episodes whose world never told its own."""
_ROUNDING_PCT = 1e-6
"""Tolerance in percent: the sum of the metres outside may exceed the driven distance in its last digits."""


class Watch:
    """Is told whose code runs and what was driven, so that a crash or a hang is blamed on the right code.

    The phases are `"reset"` (the agent's `sensors`, `consumes` and `reset`), `"act"` (the agent's `act`) and `"sim"`
    (everything else: the world, the perturbations, the recorder). Methods are called in every tick and must return at
    once. An error in a method counts as a fault of the simulation.
    """

    def phase(self, name: str, tick: int) -> None:
        """Note that the phase `name` begins in `tick`."""

    def equip(self, cameras: tuple[CameraSpec, ...], consumes: tuple[str, ...], *, privileged: bool) -> None:
        """Note the agent's cameras, its signals, and whether it sees ground truth, at the start of an episode."""

    def ticked(
        self, tick: int, state: WorldState, observation: Observation, asked: Control | None, applied: Control
    ) -> None:
        """Note a driven tick.

        `state` is the world at the time of the observation, `observation` the perturbed observation, of which the agent
        had its own copy, `asked` the agent's answer, None when the agent was not asked, and `applied` the control that
        the vehicle got.
        """

    def failed(self, error: Exception) -> None:
        """Note the error that ends the episode."""


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
        if not 0.0 < self.simulator.dt_s < math.inf:
            raise SimulationError(f"dt_s is {self.simulator.dt_s!r}, expected the seconds of a tick, above 0")
        self.dt_s = self.simulator.dt_s
        self._enter("reset")
        self.privileged = agent_privileged(self.agent)
        cameras = agent_cameras(self.agent, self.dt_s)
        consumes = agent_consumes(self.agent)
        self._watch.equip(cameras, consumes, privileged=self.privileged)
        self.witness = Witness(tuple(camera.name for camera in cameras), consumes)
        self.shows_view = bool(self._view) and not cameras
        self._enter("sim")
        self._mounted = {camera.name: camera for camera in cameras or self._view}
        self.state = _checked_state(
            "reset", self.simulator.reset(self.route, seed=self.seed, cameras=cameras or self._view)
        )
        self.plan = self.simulator.plan()
        self._enter("reset")
        agent_reset(self.agent, self.plan, self.seed)
        self._enter("sim")
        self._whose = _PERTURBATION
        self.stack = self.setting.start(route_id=self.route.id, seed=self.seed, dt_s=self.dt_s, cameras=cameras)
        self.warmup_ticks = self.stack.warmup_ticks
        self._whose = _WORLD
        self._done = _ends(self.simulator.done)

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
        captured = self._captured()
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

    def _captured(self) -> Observation:
        """Return the world's observation, checked. Raises `SimulationError`: a bad one would be blamed on the agent."""
        captured: object = self.simulator.observe()
        if not isinstance(captured, Observation):
            raise SimulationError(f"observe() gave {captured!r}, expected an Observation")
        problem = captured.signal_problem()
        if problem is not None:
            raise SimulationError(f"observe() gave an observation whose {problem}")
        if captured.cameras.keys() != self._mounted.keys():
            raise SimulationError(
                f"observe() gave images of {sorted(captured.cameras)}, expected those of {sorted(self._mounted)}"
            )
        for name, camera in self._mounted.items():
            problem = camera.image_problem(captured.cameras[name])
            if problem is not None:
                raise SimulationError(f"observe() gave an image of another kind: {problem}")
        return captured

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
        self.state = after = _checked_state("step", self.simulator.step(applied))
        ego = after.ego
        self._rows.extend((ego.x_m, ego.y_m, ego.yaw_rad, ego.speed_mps, ego.forward_mps2, ego.right_mps2))
        self._rows.extend((ego.yaw_rate_radps, applied.throttle, applied.steer, applied.brake))
        self._rows.append(self.simulator.progress_m)
        self.ticks += 1
        self._watch.ticked(tick, state, observation, control, applied)
        self._done = _ends(self.simulator.done)

    def result(self, episode: Episode) -> EpisodeResult:
        """Return the result of the episode; an `infra_error` when the world cannot report its score."""
        score: EpisodeScore | None = None
        schedule: tuple[Injection, ...] = ()
        versions: dict[str, str] = {}
        trace = self._trace()
        try:
            self._enter("sim")
            if self.state is not None and not isinstance(self.crash, SimulationError):
                score = _checked_score(self.simulator.score())
                if (problem := trace.problem()) is not None:
                    raise SimulationError(f"the world's {problem}")
            if self.stack is not None:
                schedule = _checked_schedule(self.stack.schedule())
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


def _checked_state(call: str, state: object) -> WorldState:
    """Return the state that the world returned. Raises `SimulationError` when it is no `WorldState`."""
    if not isinstance(state, WorldState):
        raise SimulationError(f"{call}() gave {state!r}, expected a WorldState")
    return state


def _ends(done: object) -> bool:
    """Return whether the world ends the episode. Raises `SimulationError` when `done` is neither an `End` nor None."""
    if done is None or isinstance(done, End):
        return done is not None
    raise SimulationError(f"done is {done!r}, expected an End, and None while the episode goes on")


def _checked_score(score: object) -> EpisodeScore:
    """Return the score of the world, checked. Raises `SimulationError` for a score that cannot be stored."""
    if not isinstance(score, EpisodeScore):
        raise SimulationError(f"score() gave {score!r}, expected an EpisodeScore")
    if not isinstance(score.end, End):
        raise SimulationError(f"score() gave the end {score.end!r}, expected an End")
    for item in score.infractions:
        if not isinstance(item, Infraction):
            raise SimulationError(f"score() gave the infraction {item!r}, expected Infraction objects")
    for field in fields(EpisodeScore):
        problem = unstorable(field.name, getattr(score, field.name))
        if problem is not None:
            raise SimulationError(f"score() gave what cannot be stored, {problem}")
    for item in score.infractions:
        if item.kind is InfractionKind.OUTSIDE_LANES and item.share_pct > 100.0 + _ROUNDING_PCT:
            raise SimulationError(f"score() gave {item.kind.value} with share_pct {item.share_pct!r}, expected 0..100")
    return score


def _checked_schedule(schedule: tuple[Injection, ...]) -> tuple[Injection, ...]:
    """Return the schedule of injections, checked. Raises `SimulationError` for a schedule that cannot be stored."""
    for item in schedule:
        if not isinstance(item, Injection):
            raise SimulationError(f"schedule() of a perturbation gave {item!r}, expected Injection objects")
    problem = unstorable("schedule", schedule)
    if problem is not None:
        raise SimulationError(f"schedule() of a perturbation gave what cannot be stored, {problem}")
    return schedule
