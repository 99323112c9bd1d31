"""Does a simulator keep the contract of `pytest_drive_robust.simulators.base.Simulator`?"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from numbers import Real

import numpy as np

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption, Route
from pytest_drive_robust.domain.truth import GroundTruth
from pytest_drive_robust.registry.making import missing_members
from pytest_drive_robust.runner.episode.contract import BLAMED, blame
from pytest_drive_robust.runner.episode.generators import borrowed_generators
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions
from pytest_drive_robust.testing.agents import RecordingAgent, ScriptedAgent
from pytest_drive_robust.testing.driving import drive, first_difference_seen
from pytest_drive_robust.testing.fake_simulator import fake_route
from pytest_drive_robust.testing.report import Broken, Check, ContractReport, attempt

_OURS = "the simulation"
_TICKS = 60
_BRAKED_S = 10.0
"""Long enough for an ego that a world starts at speed to stop, and to stand for `_STUCK_S`."""
_STUCK_S = 1.0
_STILL_MPS = 0.01
"""An ego below this speed stands, whatever limit the simulator itself uses."""
_Driven = tuple[RecordingAgent, EpisodeResult]
_SCRIPT = [Control(throttle=0.6)] * 30 + [Control(throttle=0.3, steer=0.05)] * 10 + [Control(brake=0.2)] * 20


def check_simulator(
    factory: Callable[[SimulatorOptions], Simulator], *, route: Route | None = None, seed: int = 0
) -> ContractReport:
    """Drive six episodes of 60 ticks and one to a standstill, and report which promises of the protocol hold.

    Raises nothing.
    """
    name = getattr(factory, "__name__", type(factory).__name__)
    return ContractReport(name, tuple(_Trial(factory, route or fake_route(), seed).checks()))


@dataclass
class _Trial:
    """The checks of one simulator. They share one recorded episode, with which later episodes are compared."""

    factory: Callable[[SimulatorOptions], Simulator]
    route: Route
    seed: int

    def make(self) -> Simulator:
        """Return a new simulator with the tick cap of the trial."""
        return self.factory(SimulatorOptions(tick_cap=_TICKS))

    def checks(self) -> Iterator[Check]:
        """Yield every check in order; leave out checks that need a promise that is already broken."""
        yield (members := self.attempt(self.members))
        if not members.ok:
            return
        try:
            self.record, self.result = self.scripted(self.simulator)
        except BLAMED as error:
            yield Check("end", False, f"{blame(_OURS, error)}.")
            return
        yield self.attempt(self.end)
        if self.result.outcome is Outcome.INFRA_ERROR or not self.result.ticks:
            return
        for promise in (self.plan, self.versions, self.stamps, self.truth, self.states, self.stuck):
            yield self.attempt(promise)
        yield from self.repeated()
        yield self.attempt(self.close)

    def repeated(self) -> Iterator[Check]:
        """Drive the first episode again; stop at a fault that would show in all later drives."""
        yield (same := self.attempt(self.determinism))
        if not same.ok:
            return
        yield (forgets := self.attempt(self.reset))
        if forgets.ok:
            yield self.attempt(self.isolation)
            yield self.attempt(self.globals)

    def attempt(self, promise: Callable[[], str]) -> Check:
        """Return the check of one promise. An exception of the simulator fails it and does not end the others."""
        return attempt(_OURS, promise)

    def scripted(self, simulator: Simulator) -> _Driven:
        """Drive `_SCRIPT` on the route; return the recording and the result."""
        return drive(ScriptedAgent(_SCRIPT, cameras=_cameras(simulator)), simulator, route=self.route, seed=self.seed)

    def members(self) -> str:
        """Check that the factory gives an object with every member of the protocol."""
        try:
            self.simulator = simulator = self.make()
        except BLAMED as error:
            raise Broken(f"{blame('the factory', error)}.") from None
        missing = missing_members(simulator, Simulator)
        if missing:
            raise Broken(f"{type(simulator).__name__} lacks {', '.join(missing)}.")
        dt_s: object = simulator.dt_s
        if not isinstance(dt_s, Real) or not float(dt_s) > 0.0:
            raise Broken(f"dt_s is {dt_s!r}, expected the seconds of a tick.")
        return "every member of the protocol is there."

    def end(self) -> str:
        """Check that the recorded episode ends in time, with one reason."""
        result = self.result
        if result.outcome is Outcome.INFRA_ERROR:
            raise Broken(f"tick {result.ticks}: {result.end_detail}.")
        if not result.ticks:
            raise Broken(f"the episode is over after 0 ticks ({result.end.value}): done is None after reset.")
        if result.ticks > _TICKS:
            raise Broken(f"the episode took {result.ticks} ticks under a tick_cap of {_TICKS}.")
        problem = _two_ends(self.simulator, result)
        if problem is not None:
            raise Broken(problem)
        if not 0.0 <= result.route_completion_pct <= 100.0:
            raise Broken(f"route_completion_pct is {result.route_completion_pct!r}, expected 0..100.")
        return f"the episode ends after {result.ticks} ticks: {result.end.value}."

    def plan(self) -> str:
        """Check the plan that `Agent.reset` gets: the agent would be blamed for a plan that nobody can follow."""
        plan: object = self.record.plan
        if not isinstance(plan, GlobalPlan):
            raise Broken(f"plan gave {plan!r}, expected a GlobalPlan.")
        if not plan.points:
            raise Broken("plan gave no points, expected those of the route.")
        for point in (*plan.points, *plan.dense):
            if not isinstance(point, PlanPoint) or not (math.isfinite(point.x_m) and math.isfinite(point.y_m)):
                raise Broken(f"plan gave {point!r}, expected a PlanPoint with finite x_m and y_m.")
            if not isinstance(point.command, RoadOption):
                raise Broken(f"plan gave the command {point.command!r}, expected a RoadOption.")
        return f"the agent is given {len(plan.points)} points of the route."

    def versions(self) -> str:
        """Check that versions are texts by name."""
        versions: object = self.simulator.versions()
        if not isinstance(versions, Mapping):
            raise Broken(f"versions gave {versions!r}, expected names with their versions.")
        for name, version in versions.items():
            if not (isinstance(name, str) and isinstance(version, str)):
                raise Broken(f"versions has {name!r}: {version!r}, expected text for text.")
        return f"{', '.join(versions) or 'nothing'} decides the numbers."

    def stamps(self) -> str:
        """Check that every signal carries the tick of its capture."""
        for tick, seen in enumerate(self.record.observations):
            ego_ticks = {seen.tick, seen.gps.tick, seen.compass.tick, seen.imu.tick, seen.speed.tick}
            if ego_ticks != {tick}:
                raise Broken(f"in tick {tick}, GPS, compass, IMU and speed are of {sorted(ego_ticks)}.")
            for camera in _cameras(self.simulator):
                period = round(1.0 / (self.simulator.dt_s * camera.rate_hz))
                expected, image = tick - tick % period, seen.cameras.get(camera.name)
                if image is not None and (stamped := image.tick) != expected:
                    told = f"tick {tick}: {camera.name} at {camera.rate_hz:g} Hz is stamped {stamped}"
                    raise Broken(f"{told}, expected {expected}.")
        return "every signal carries the tick of its capture, images at their own rate."

    def truth(self) -> str:
        """Check that `observe` leaves the ground truth out, and that states count from 0."""
        simulator = self.simulator
        try:
            before = simulator.reset(self.route, seed=self.seed, cameras=_cameras(self.simulator))
            observation, truth = simulator.observe(), simulator.truth()
            after = simulator.step(Control.NEUTRAL)
        except BLAMED as error:
            raise Broken(f"{blame(_OURS, error)}.") from None
        if not isinstance(truth, GroundTruth):
            raise Broken(f"truth gave {truth!r}, expected a GroundTruth.")
        if observation.truth is not None:
            raise Broken("observe gives the ground truth away: leave truth out.")
        if (before.tick, truth.state.tick, after.tick) != (0, 0, 1):
            told = f"reset, truth and step give states of ticks {before.tick}, {truth.state.tick} and {after.tick}"
            raise Broken(f"{told}, expected 0, 0 and 1.")
        return "observe leaves the ground truth out, and states count from 0."

    def states(self) -> str:
        """Check that later ticks do not change a state: a state is recorded, drawn and judged after the next step."""
        simulator = self.simulator
        states = [simulator.reset(self.route, seed=self.seed, cameras=())]
        before = [(np.array(states[0].actors), np.array(states[0].lights))]
        for control in _SCRIPT:
            if simulator.done is not None:
                break
            simulator.observe()
            states.append(simulator.step(control))
            before.append((np.array(states[-1].actors), np.array(states[-1].lights)))
        for tick, (state, kept) in enumerate(zip(states, before, strict=True)):
            for name, array in zip(("actors", "lights"), kept, strict=True):
                if not np.array_equal(getattr(state, name), array, equal_nan=True):
                    told = f"{name} of the state of tick {tick} are others after later ticks"
                    raise Broken(f"{told}: give each state arrays of its own.")
        return "a state stays as it is while the world goes on."

    def stuck(self) -> str:
        """Check that an episode ends once the ego stood for `stuck_stop_s`."""
        dt_s = float(self.simulator.dt_s)
        simulator = self.factory(SimulatorOptions(tick_cap=round(_BRAKED_S / dt_s), stuck_stop_s=_STUCK_S))
        _, result = drive(ScriptedAgent([Control(brake=1.0)]), simulator, route=self.route, seed=self.seed)
        problem = _two_ends(simulator, result)
        simulator.close()
        if result.outcome is Outcome.INFRA_ERROR:
            raise Broken(f"an ego that brakes: tick {result.ticks}: {result.end_detail}.")
        if problem is not None:
            raise Broken(f"an ego that brakes: {problem}")
        if result.end is End.STUCK:
            return f"the episode ends once the ego stood for {_STUCK_S:g} s."
        moved = np.flatnonzero(np.abs(result.trace.column("speed_mps")) >= _STILL_MPS)
        stood_s = (result.ticks - (moved[-1] + 1 if len(moved) else 0)) * dt_s
        if stood_s >= 2.0 * _STUCK_S:
            told = f"the ego stood for {stood_s:g} s under a stuck_stop_s of {_STUCK_S:g}"
            raise Broken(f"{told}, and the end is {result.end.value}: end such an episode with End.STUCK.")
        return "not tried: an ego that brakes does not stand long enough here."

    def isolation(self) -> str:
        """Check that an agent that paints over its images sees the same world as one that does not."""
        script = iter(self.record.controls)

        def scribble(observation: Observation) -> Control:
            for image in observation.cameras.values():
                image.pixels[:] = 255
            return next(script)

        agent = ScriptedAgent(scribble, cameras=_cameras(self.simulator))
        painted, _ = drive(agent, self.simulator, route=self.route, seed=self.seed)
        tick = first_difference_seen(self.record.observations, painted.observations)
        if tick is not None:
            raise Broken(f"writing to an image changes what is seen in tick {tick}.")
        return "writing to an image changes nothing in later ticks."

    def globals(self) -> str:
        """Check that a world shares nothing with an agent that draws from global generators or a world beside it."""
        beside = self.make()
        script = iter(self.record.controls)

        def draw(observation: Observation) -> Control:
            random.random()
            np.random.random()
            if beside.done is None:
                beside.observe()
                beside.step(Control.NEUTRAL)
            return next(script)

        with borrowed_generators("check_simulator"):
            beside.reset(self.route, seed=self.seed + 1, cameras=())
            agent = ScriptedAgent(draw, cameras=_cameras(self.simulator))
            shared, _ = drive(agent, self.simulator, route=self.route, seed=self.seed)
        beside.close()
        tick = first_difference_seen(self.record.observations, shared.observations)
        if tick is not None:
            told = f"draws from global generators, or a world beside this one, change what is seen in tick {tick}"
            raise Broken(f"{told}: draw from a generator of the object, and keep all state in it.")
        return "neither draws from global generators nor a world beside this one reach it."

    def determinism(self) -> str:
        """Check that a new world with the same route and seed is the same to the bit."""
        fresh = self.make()
        difference = self.difference(self.scripted(fresh))
        fresh.close()
        if difference is not None:
            raise Broken(f"a new world with the same route and seed {difference}.")
        return "a new world with the same route and seed is the same to the bit."

    def reset(self) -> str:
        """Check that `reset` leaves nothing of the last episode."""
        difference = self.difference(self.scripted(self.simulator))
        if difference is not None:
            told = f"after other episodes, the same route and seed {difference}"
            raise Broken(f"{told}: build in reset all that an episode changes.")
        return "nothing is left of the last episode."

    def difference(self, again: _Driven) -> str | None:
        """Return in a clause how a second drive of the episode differs, or None when both are the same to the bit."""
        record, result, (other_record, other) = self.record, self.result, again
        if other.outcome is Outcome.INFRA_ERROR:
            return f"breaks in tick {other.ticks}: {other.end_detail}"
        if record.plan != other_record.plan:
            return "has another plan"
        tick = first_difference_seen(record.observations, other_record.observations)
        if tick is not None:
            return f"looks different in tick {tick}"
        if result.trace.digest != other.trace.digest:
            return "moves the ego differently"
        for name in ("end", "route_completion_pct", "infractions"):
            one, two = repr(getattr(result, name)), repr(getattr(other, name))  # as text: no number is equal to nan
            if one != two:
                return f"has another score: {name} {two} in place of {one}"
        return None

    def close(self) -> str:
        """Check that closing twice does no harm."""
        try:
            self.simulator.close()
            self.simulator.close()
        except BLAMED as error:
            raise Broken(f"{blame('close', error)}.") from None
        return "closing twice does no harm."


def _cameras(simulator: Simulator) -> tuple[CameraSpec, CameraSpec]:
    """Return two cameras: one captures in every tick, the other in every second tick, whatever the tick rate."""
    dt_s = float(simulator.dt_s)
    return (
        CameraSpec("front", width_px=32, height_px=18, rate_hz=1.0 / dt_s),
        CameraSpec("rear", width_px=24, height_px=16, rate_hz=0.5 / dt_s),
    )


def _two_ends(simulator: Simulator, result: EpisodeResult) -> str | None:
    """Return a sentence if `done` and `score()` disagree about the end, or None."""
    done = simulator.done
    if done is result.end:
        return None
    return f"done is {done!r}, but score() has the end {result.end!r}: both say why the episode is over."
