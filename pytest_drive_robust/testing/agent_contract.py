"""Does an agent keep the contract of `pytest_drive_robust.Agent`? One small function for each promise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from pytest_drive_robust.domain.agent import SIGNALS, Agent, PlannedPath, consumed_signals, offers_lockstep
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.domain.truth import GroundTruth
from pytest_drive_robust.errors import AgentError, UsageError
from pytest_drive_robust.registry.exits import exits_raised
from pytest_drive_robust.runner.cache_key.declared import undeclared
from pytest_drive_robust.runner.cache_key.weights import weights_digest
from pytest_drive_robust.runner.episode.contract import BLAMED, agent_act_batch, agent_consumes, agent_plan, blame
from pytest_drive_robust.runner.episode.generators import borrowed_generators
from pytest_drive_robust.runner.episode.threads import OneThread
from pytest_drive_robust.runner.lockstep.check import Recording, check_lockstep
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions
from pytest_drive_robust.testing.agents import RecordingAgent, ScriptedAgent
from pytest_drive_robust.testing.driving import drive, feed, first_difference, first_difference_seen
from pytest_drive_robust.testing.fake_simulator import FakeSimulator, fake_route
from pytest_drive_robust.testing.report import Broken, Check, ContractReport, attempt
from pytest_drive_robust.testing.time_limit import with_time_limit

_EPISODE_TICKS = 120
_OTHER_LENGTH_M = 45.0
_SLOWEST_ACT_S = 5.0
_LOCKSTEP_OBSERVATIONS = 12
_LOCKSTEP_ROWS = 4
_SAME_POLICY = 0.01
_BROKEN = (Outcome.AGENT_ERROR, Outcome.INFRA_ERROR)
_METHODS = ("sensors", "reset", "act")


def check_agent(
    agent_factory: Callable[[], Agent],
    *,
    simulator: Simulator | None = None,
    route: Route | None = None,
    other_route: Route | None = None,
    seed: int = 0,
    subject: str = "",
    act_timeout_s: float | None = None,
    told: Callable[[Check], object] = lambda check: None,
) -> ContractReport:
    """Drive a few episodes and report which promises of the contract hold.

    `agent_factory` makes a new agent on every call. Without `simulator` and `route`, the agent drives 120 ticks of
    `FakeSimulator`; give your own for an agent that needs a real scene. The check of `reset` first drives `other_route`
    with another seed (default: `route`, or a second fake route). `told` is called with each check as soon as its result
    is known. A call of the agent may take `act_timeout_s` seconds; this limit needs signals, so it works in the main
    thread only, and not on Windows. Libraries compute on one thread meanwhile, as in a run. Errors of the agent are
    reported, not raised.
    """
    world = simulator or FakeSimulator(SimulatorOptions(tick_cap=_EPISODE_TICKS))
    name = subject or getattr(agent_factory, "__name__", type(agent_factory).__name__)
    other = other_route or route or fake_route("2", length_m=_OTHER_LENGTH_M)
    trial = _Trial(agent_factory, world, route or fake_route(), other, seed, act_timeout_s)
    checks = []
    with exits_raised(), OneThread() as one_thread:  # as in a run: sums over several threads differ in the last bits
        for check in trial.checks():
            one_thread.limit()  # also libraries that the first check loads with the agent
            told(check)
            checks.append(check)
    return ContractReport(name, tuple(checks))


@dataclass
class _Trial:
    """The checks of one agent. They share one recorded episode, with which later episodes are compared."""

    factory: Callable[[], Agent]
    simulator: Simulator
    route: Route
    other: Route
    seed: int
    act_timeout_s: float | None

    def make(self) -> Agent:
        """Return a new agent. Its constructor draws the same random numbers every time, as in a run."""
        with borrowed_generators("check_agent"):
            agent = self.factory()
        return agent if self.act_timeout_s is None else with_time_limit(agent, self.act_timeout_s)

    def checks(self) -> Iterator[Check]:
        """Yield every check in order; leave out checks that need a promise that is already broken."""
        for first in (self.methods, self.declarations, self.controls):
            yield (check := attempt("the agent", first))
            if not check.ok:
                return
        self.truth: GroundTruth = self.simulator.truth()
        yield attempt("the agent", self.time)
        yield (same := attempt("the agent", self.determinism))
        self.repeats = same.ok
        compared = (self.reset, self.isolation, self.consumes, self.privileged)
        # an agent that never drives the same twice would fail every comparison: report this fault once
        for promise in (*compared, self.plan, self.lockstep) if same.ok else (self.plan,):
            yield attempt("the agent", promise)

    def drive(self, agent: Agent, seed: int) -> tuple[RecordingAgent, EpisodeResult]:
        """Return one whole episode on the route of the trial."""
        return drive(agent, self.simulator, route=self.route, seed=seed)

    def methods(self) -> str:
        """Check that the factory gives an object with the three methods."""
        try:
            agent = self.make()
        except BLAMED as error:
            raise Broken(f"{blame('the factory', error)}.") from None
        missing = [name for name in _METHODS if not callable(getattr(agent, name, None))]
        if missing:
            raise Broken(f"{type(agent).__name__} lacks {', '.join(missing)}.")
        return "sensors, reset and act are there."

    def declarations(self) -> str:
        """Check `consumes` (names of signals), `privileged` (a bool), and that keys can have all other declarations."""
        agent = self.make()
        privileged = getattr(agent, "privileged", False)
        if not isinstance(privileged, bool):
            raise Broken(f"privileged is {privileged!r}, expected True or False.")
        consumed = agent_consumes(agent)
        # a lambda around the class is only part of this check, so declarations of the class count as well
        late = sorted({*undeclared(agent, self.factory)} & {*undeclared(agent, type(agent))})
        if late:
            told = f"{' and '.join(late)} of the object are not those of the class or factory: no key has them."
            raise Broken(f"{told} Set them in the body of the class, not in __init__.")
        try:
            for owner in (type(agent), self.factory):
                weights_digest(owner, agent=type(agent).__name__)
        except UsageError as error:
            raise Broken(str(error)) from None
        return f"consumes {', '.join(consumed) or 'no signal'}."

    def controls(self) -> str:
        """Check a recorded episode: no exception, NaN, wrong type, value out of range or impossible camera."""
        self.record, result = self.drive(self.make(), self.seed)
        if result.outcome in _BROKEN:
            raise _broken("", result)
        return f"{len(self.record.controls)} controls, every one within its ranges."

    def time(self) -> str:
        """Report how long `act` takes; fail only if an episode would take hours."""
        acts_s = self.record.acts_s
        mean_s, worst_s = sum(acts_s) / len(acts_s), max(acts_s)
        sentence = f"act takes {1000.0 * mean_s:.3f} ms on average, {1000.0 * worst_s:.3f} ms at most."
        if mean_s > _SLOWEST_ACT_S:
            raise Broken(f"{sentence} More than {_SLOWEST_ACT_S:g} s: an episode would take hours.")
        return sentence

    def determinism(self) -> str:
        """Check that two new agents with the same seed drive the same."""
        again, result = self.drive(self.make(), self.seed)
        if result.outcome in _BROKEN:
            raise _broken(f"a second agent with seed {self.seed} breaks: ", result)
        tick = first_difference(self.record.controls, again.controls)
        if tick is not None:
            advice = (
                "Draw all randomness from the seed that reset gets, read no clock, keep nothing outside the object."
            )
            raise Broken(f"two agents with seed {self.seed} differ from act {tick} on. {advice}")
        return f"two agents with seed {self.seed} drive the same."

    def reset(self) -> str:
        """Check that an agent object drives like a new one after another episode, and again after the same episode."""
        agent = self.make()
        _, result = drive(agent, self.simulator, route=self.other, seed=self.seed + 1)
        if result.outcome in _BROKEN:
            raise _broken(f"an episode on {self.other.label} breaks: ", result)
        for before in (f"an episode on {self.other.label}", "the same episode"):
            again, result = self.drive(agent, self.seed)
            if result.outcome in _BROKEN:
                raise _broken(f"after {before} the next one breaks: ", result)
            tick = first_difference(self.record.controls, again.controls)
            if tick is not None:
                told = f"after {before} the agent still remembers it: from act {tick} on it differs from a new agent"
                advice = "Set in reset every attribute that reset or act changes, also the caches and the hidden state."
                raise Broken(f"{told}. {advice}")
        return "after other episodes and reset, the agent drives like a new one."

    def isolation(self) -> str:
        """Check that the recorded controls, replayed, lead to the same observations: the agent changed nothing else."""
        script = ScriptedAgent(self.record.controls, cameras=self.record.sensors())
        replayed, _ = self.drive(script, self.seed)
        tick = first_difference_seen(self.record.observations, replayed.observations)
        if tick is not None:
            told = f"something that the agent wrote to changed what is seen in tick {tick}: write to copies"
            raise Broken(f"{told}.")
        return "the agent changes the world by its controls only."

    def consumes(self) -> str:
        """Check that signals that are not declared do not change the controls."""
        agent = self.make()
        others = [signal for signal in SIGNALS if signal not in consumed_signals(agent)]
        expected = self.feed()
        for signal in others:
            tick = first_difference(expected, self.feed(_CHANGES[signal]))
            if tick is not None:
                raise Broken(f"{signal} changes the control of act {tick}: declare it in consumes.")
        if not others:
            return "every signal is declared."
        reach = "reach" if len(others) > 1 else "reaches"
        return f"{', '.join(others)} {reach} no control, as declared."

    def privileged(self) -> str:
        """Check that ground truth changes the controls of a privileged agent, and of no other agent."""
        if not getattr(self.make(), "privileged", False):
            with_truth = self.feed(lambda observation: replace(observation, truth=self.truth))
            if first_difference(self.feed(), with_truth) is not None:
                raise Broken("the agent reads observation.truth: declare privileged = True.")
            return "the agent does without ground truth."
        try:
            blind = self.feed(lambda observation: replace(observation, truth=None))
        except AgentError:
            return "the agent needs the ground truth that it asks for."
        if first_difference(self.record.controls, blind) is None:
            raise Broken("the same is driven without ground truth: remove privileged = True.")
        return "the agent uses the ground truth that it asks for."

    def plan(self) -> str:
        """Check that `plan()`, where there is one, gives a finite `PlannedPath` after `act`."""
        agent = self.make()
        if getattr(agent, "plan", None) is None:
            return "there is no plan() to show, and none is needed."
        feed(agent, self.record.observations[:1], plan=self.route_plan, seed=self.seed)
        planned: object = agent_plan(agent)
        if not isinstance(planned, PlannedPath):
            raise Broken(f"plan returned {type(planned).__name__}, expected a PlannedPath.")
        count = 0
        for name in ("path", "target_points", "speed_points"):
            points = getattr(planned, name)
            try:
                finite, count = all(math.isfinite(value) for point in points for value in point), count + len(points)
            except TypeError:
                raise Broken(f"plan returned the {name} {points!r}, expected rows of numbers.") from None
            if not finite:
                raise Broken(f"plan returned a point of {name} that is not finite.")
        tick = first_difference(self.record.controls, self.feed(after_act=agent_plan)) if self.repeats else None
        if tick is not None:
            told = f"plan changes the control of act {tick}: it is for pictures, and not asked in every tick"
            raise Broken(f"{told}. Let it return what act has kept.")
        return f"plan gives {count} points."

    def lockstep(self) -> str:
        """Check that `act_batch`, where there is one, agrees with `act`, and no control depends on other agents."""
        agents = [self.make() for _ in range(_LOCKSTEP_ROWS)]
        if not offers_lockstep(agents[0]):
            return "there is no act_batch(), and none is needed."
        seen = self.record.observations[:: max(len(self.record.observations) // _LOCKSTEP_OBSERVATIONS, 1)]
        recording = Recording(self.route_plan, self.seed, tuple(seen))
        problem = check_lockstep(self.make, [recording])
        if problem is not None:
            raise Broken(problem)
        singly = feed(self.make(), seen, plan=recording.plan, seed=self.seed)
        for agent in agents:
            agent.reset(recording.plan, self.seed)
        together = [agent_act_batch(agents, [moment.private() for _ in agents])[0] for moment in seen]
        for tick, one, other in zip((moment.tick for moment in seen), singly, together, strict=True):
            if isinstance(other, AgentError) or _distance(one, other) > _SAME_POLICY:
                raise Broken(f"in tick {tick} act gives {one}, but act_batch gives {other}.")
        return "act_batch drives like act, and no control depends on who shares the batch."

    def feed(
        self,
        change: Callable[[Observation], Observation] = lambda observation: observation,
        *,
        after_act: Callable[[Agent], object] = lambda agent: None,
    ) -> list[Control]:
        """Return a new agent's controls for the recorded observations (see `driving.feed`)."""
        seen, plan = self.record.observations, self.route_plan
        return feed(self.make(), seen, plan=plan, seed=self.seed, change=change, after_act=after_act)

    @property
    def route_plan(self) -> GlobalPlan:
        """The plan that the recorded episode began with."""
        assert self.record.plan is not None  # the recorded episode began with reset
        return self.record.plan


def _broken(when: str, result: EpisodeResult) -> Broken:
    """Return the error for an episode that broke, with where and why."""
    told = f"{when}tick {result.ticks}: {result.end_detail}."
    return Broken(told, of_simulator=result.outcome is Outcome.INFRA_ERROR)


def _distance(one: Control, other: Control) -> float:
    pedals = max(abs(one.throttle - other.throttle), abs(one.brake - other.brake))
    return max(pedals, abs(one.steer - other.steer))


_CHANGES: dict[str, Callable[[Observation], Observation]] = {
    "cameras": lambda seen: seen.map_images(lambda _, image: Image(255 - image.pixels, image.tick)),
    "gps": lambda seen: replace(seen, gps=replace(seen.gps, x_m=seen.gps.x_m + 30.0, y_m=seen.gps.y_m - 30.0)),
    "compass": lambda seen: replace(seen, compass=replace(seen.compass, heading_rad=seen.compass.heading_rad + 1.0)),
    "imu": lambda seen: replace(seen, imu=replace(seen.imu, forward_mps2=4.0, right_mps2=-4.0, yaw_rate_radps=1.0)),
    "speed": lambda seen: replace(seen, speed=replace(seen.speed, mps=seen.speed.mps + 10.0)),
}
