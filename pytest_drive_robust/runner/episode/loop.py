"""The closed loop: one agent drives one episode, and every end of it becomes an `EpisodeResult`.

`RunningEpisode` is an episode in steps, so that one loop can drive one (`drive_episode`) and another one many at once
(`runner.driver`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol, TypeVar

from pytest_drive_robust.domain.agent import is_privileged
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import AgentError, SimulationError
from pytest_drive_robust.runner.episode.contract import agent_act, agent_cameras, agent_consumes, agent_reset, blame
from pytest_drive_robust.runner.episode.recorder import Recorder
from pytest_drive_robust.runner.episode.surroundings import Surroundings
from pytest_drive_robust.runner.episode.witness import Witness

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent
    from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
    from pytest_drive_robust.domain.result import Injection
    from pytest_drive_robust.domain.route import GlobalPlan, Route
    from pytest_drive_robust.domain.truth import GroundTruth, WorldState
    from pytest_drive_robust.perturbations.base import RunningStack, Setting
    from pytest_drive_robust.simulators.base import EpisodeScore, Simulator

    OnTick = Callable[[int, WorldState, Observation, Control], object]

__all__ = ["RunningEpisode", "Watch", "drive_episode", "private_truth", "tell_phase"]

_Given = TypeVar("_Given")
_OUTCOMES = {
    End.COMPLETED: Outcome.COMPLETED,
    End.AGENT_CRASHED: Outcome.AGENT_ERROR,
    End.SIMULATION_CRASHED: Outcome.INFRA_ERROR,
}  # every other end is the agent's failure


class Watch(Protocol):
    """Is told at any moment whose code runs, so that a death or a hang is blamed on the right one.

    The phases are `"reset"` (the agent's `sensors`, `consumes` and `reset`), `"act"` (the agent's `act`) and `"sim"`
    (everything else: the world, the perturbations, the recorder).
    """

    def phase(self, name: str, tick: int) -> None:
        """Note that from now on the code of `name` runs, in `tick`. Called up to twice per tick: return at once."""
        ...


def drive_episode(
    simulator: Simulator,
    agent: Agent,
    *,
    route: Route,
    setting: Setting,
    seed: int,
    agent_name: str,
    on_tick: OnTick | None = None,
    watch: Watch | None = None,
) -> EpisodeResult:
    """Drive one episode to its end. Never raises for what the agent, the simulator or a perturbation does.

    What the agent does wrong (exception, `sys.exit`, NaN, wrong type, bad cameras) ends in `agent_error`, with what
    was driven so far scored. What the simulator or a perturbation does wrong ends in `infra_error`, never scored.
    KeyboardInterrupt, and whatever `on_tick` raises, goes through to the caller.

    While the warm-up of the setting lasts the vehicle gets `Control.NEUTRAL`, whatever the agent says.

    `on_tick(tick, state, observation, control)` is called after every tick with the world at the moment of the
    observation, the observation as perturbed (not the agent's own copy of it), and the control that the vehicle got.
    `watch` is told whose code runs; what it raises counts as a fault of the simulation.
    """
    running = RunningEpisode(simulator, agent, route, setting, seed, watch=watch)
    running.attempt(running.start)
    while not running.over:
        running.attempt(running.tick)
        if on_tick is not None and running.last_tick is not None:
            on_tick(*running.last_tick)
    return running.result(Episode(agent_name, route.id, str(setting), seed))


class RunningEpisode:
    """An episode under way: whose fault its end is, and what was recorded until then.

    `start`, then as long as it is not `over`: `sense`, `ask` when there is something to see, `advance`; `tick` is these
    three. Each goes through `attempt`, which keeps what they raise. At the end `result`.

    `view` is a camera for people, mounted where the agent has none: its images are in `images`, and nowhere else.
    `asked` is the tick of the agent's newest answer with that answer.
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
        self.started_s = time.perf_counter()
        self.recorder = Recorder()
        self.surroundings = Surroundings()
        self.witness = Witness()
        self.crash: AgentError | SimulationError | None = None
        self.last_tick: tuple[int, WorldState, Observation, Control] | None = None
        self.stack: RunningStack | None = None
        self.state: WorldState | None = None
        self.images: Mapping[str, Image] = {}
        self.asked: tuple[int, Control] | None = None
        self._watch = watch
        self._view = () if view is None else (view,)
        self._seen: Observation | None = None
        self._done = False

    @property
    def over(self) -> bool:
        """Return True once nothing more can be driven."""
        return self._done or self.crash is not None

    def attempt(self, action: Callable[[], _Given]) -> _Given | None:
        """Return what `action` returns; when it raises, keep whose fault it is and return None."""
        self.last_tick = None
        try:
            return action()
        except AgentError as error:
            self.crash = error
        except SimulationError as error:
            self.crash = error
        except Exception as error:
            self.crash = SimulationError(blame("the simulation", error))
        return None

    def start(self) -> None:
        """Build the world, then reset the agent and the perturbations."""
        self._enter("reset")
        self.privileged = is_privileged(self.agent)
        cameras = agent_cameras(self.agent, self.simulator.dt_s)
        self.witness = Witness(tuple(camera.name for camera in cameras), agent_consumes(self.agent))
        self.shows_view = bool(self._view) and not cameras
        self._enter("sim")
        self.state = self.simulator.reset(self.route, seed=self.seed, cameras=cameras or self._view)
        self.plan = self.simulator.plan()
        self._enter("reset")
        agent_reset(self.agent, self.plan, self.seed)
        self._enter("sim")
        self.stack = self.setting.start(
            route_id=self.route.id, seed=self.seed, dt_s=self.simulator.dt_s, cameras=cameras
        )
        self.warmup_ticks = self.stack.warmup_ticks
        self._done = self.simulator.done is not None

    def tick(self) -> None:
        """Observe, ask the agent when its computer is free, step the world."""
        given = self.sense()
        if given is None:
            self.advance(None, 0.0)
            return
        self.advance(*self.ask(given))

    def sense(self) -> Observation | None:
        """Return what the agent is to act on in this tick, in memory of its own; None while its computer is busy."""
        stack = self.stack
        assert stack is not None  # start() came before
        captured = self.simulator.observe()
        self.images = captured.cameras
        if self.shows_view:
            captured = replace(captured, cameras={})
        self._seen = observation = stack.observe(captured)
        if not stack.wants_inference(self.recorder.ticks):
            return None
        self.witness.seen(captured, observation)
        given = observation.private()
        if self.privileged:
            return replace(given, truth=private_truth(self.simulator.truth()))
        return given if given.truth is None else replace(given, truth=None)

    def ask(self, given: Observation) -> tuple[Control, float]:
        """Return the agent's answer to what `sense` gave it, and the seconds that it took."""
        self._enter("act")
        asked_s = time.perf_counter()
        control = agent_act(self.agent, given)
        inference_s = time.perf_counter() - asked_s
        self.asked = self.recorder.ticks, control
        self._enter("sim")
        return control, inference_s

    def advance(self, control: Control | None, inference_s: float) -> None:
        """Step the world: `control` is the agent's answer to what `sense` gave it, None when it was not asked."""
        tick, state, stack, observation = self.recorder.ticks, self.state, self.stack, self._seen
        assert state is not None  # start() and sense() came before
        assert stack is not None
        assert observation is not None
        if self.surroundings.wants(tick):
            self.surroundings.see(tick, state)
        if control is not None and self.surroundings.wants_plan(tick):
            self._enter("act")
            self.surroundings.see_plan(tick, self.agent)
            self._enter("sim")
        applied = stack.actuate(tick, control, inference_s)
        if applied is not control and (problem := applied.problem()) is not None:
            raise SimulationError(f"the perturbations gave the vehicle {applied!r}: {problem}")
        if tick < self.warmup_ticks:
            applied = Control.NEUTRAL  # the clean twin waits as long: no part of what the setting changes
        else:
            self.witness.applied(tick, control, applied)
        self.state = self.simulator.step(applied)
        self.recorder.add(self.state.ego, applied, self.simulator.progress_m)
        self.last_tick = (tick, state, observation, applied)
        self._done = self.simulator.done is not None

    def result(self, episode: Episode) -> EpisodeResult:
        """Return what came of the episode. A world that cannot report its score makes it an `infra_error`."""
        score: EpisodeScore | None = None
        schedule: tuple[Injection, ...] = ()
        versions: dict[str, str] = {}
        try:
            self._enter("sim")
            if self.state is not None and not isinstance(self.crash, SimulationError):
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
            given=self.witness.given(),
            tracks=self.surroundings.tracks(),
        )

    def _enter(self, phase: str) -> None:
        tell_phase(self._watch, phase, self.recorder.ticks)

    def _end(self, score: EpisodeScore | None) -> tuple[End, str]:
        if isinstance(self.crash, AgentError):
            return End.AGENT_CRASHED, str(self.crash)
        if self.crash is not None or score is None:
            return End.SIMULATION_CRASHED, str(self.crash)
        return score.end, score.end_detail


def tell_phase(watch: Watch | None, phase: str, tick: int) -> None:
    """Tell `watch`, where there is one, whose code runs from now on."""
    if watch is not None:
        watch.phase(phase, tick)


def private_truth(truth: GroundTruth) -> GroundTruth:
    """Return the truth of this moment in arrays of its own. The lane map is static and stays shared: read it only."""
    frame = replace(truth.frame, actors=truth.frame.actors.copy(), lights=truth.frame.lights.copy())
    return replace(truth, frame=frame, route=truth.route.copy())
