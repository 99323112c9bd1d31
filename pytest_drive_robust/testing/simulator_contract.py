"""Does a simulator keep the contract of `pytest_drive_robust.simulators.base.Simulator`?"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping
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
from pytest_drive_robust.testing.report import Check, ContractReport, attempt

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
    return ContractReport(name, tuple(_checks(factory, route or fake_route(), seed)))


def _checks(factory: Callable[[SimulatorOptions], Simulator], route: Route, seed: int) -> Iterator[Check]:
    try:
        simulator = factory(SimulatorOptions(tick_cap=_TICKS))
    except BLAMED as error:
        yield Check("members", False, f"{blame('the factory', error)}.")
        return
    yield (members := attempt(_OURS, _members, simulator))
    if not members.ok:
        return
    try:
        first = record, result = _scripted(simulator, route, seed)
    except BLAMED as error:
        yield Check("end", False, f"{blame(_OURS, error)}.")
        return
    yield attempt(_OURS, _end, simulator, result)
    if result.outcome is Outcome.INFRA_ERROR or not result.ticks:
        return
    yield attempt(_OURS, _plan, record.plan)
    yield attempt(_OURS, _versions, simulator)
    yield attempt(_OURS, _stamps, record.observations, simulator.dt_s)
    yield attempt(_OURS, _truth, simulator, route, seed)
    yield attempt(_OURS, _states, simulator, route, seed)
    yield attempt(_OURS, _stuck, factory, simulator.dt_s, route, seed)
    yield from _repeated(simulator, factory, route, seed, first)
    yield attempt(_OURS, _close, simulator)


def _repeated(
    simulator: Simulator, factory: Callable[[SimulatorOptions], Simulator], route: Route, seed: int, first: _Driven
) -> Iterator[Check]:
    """Drive the first episode again; stop at a fault that would show in all later drives."""
    yield (same := attempt(_OURS, _determinism, factory, route, seed, first))
    if not same.ok:
        return
    yield (forgets := attempt(_OURS, _reset, simulator, route, seed, first))
    if forgets.ok:
        yield attempt(_OURS, _isolation, simulator, route, seed, first[0])
        yield attempt(_OURS, _globals, simulator, factory, route, seed, first[0])


def _cameras(dt_s: float) -> tuple[CameraSpec, CameraSpec]:
    """Return two cameras: one captures in every tick, the other in every second tick, whatever the tick rate."""
    return (
        CameraSpec("front", width_px=32, height_px=18, rate_hz=1.0 / float(dt_s)),
        CameraSpec("rear", width_px=24, height_px=16, rate_hz=0.5 / float(dt_s)),
    )


def _scripted(simulator: Simulator, route: Route, seed: int) -> _Driven:
    """Drive `_SCRIPT` on the route; return the recording and the result."""
    return drive(ScriptedAgent(_SCRIPT, cameras=_cameras(simulator.dt_s)), simulator, route=route, seed=seed)


def _members(simulator: Simulator) -> Check:
    missing = missing_members(simulator, Simulator)
    if missing:
        return Check("members", False, f"{type(simulator).__name__} lacks {', '.join(missing)}.")
    dt_s: object = simulator.dt_s
    if not isinstance(dt_s, Real) or not float(dt_s) > 0.0:
        return Check("members", False, f"dt_s is {dt_s!r}, expected the seconds of a tick.")
    return Check("members", True, "every member of the protocol is there.")


def _end(simulator: Simulator, result: EpisodeResult) -> Check:
    if result.outcome is Outcome.INFRA_ERROR:
        return Check("end", False, f"tick {result.ticks}: {result.end_detail}.")
    if not result.ticks:
        return Check("end", False, f"the episode is over after 0 ticks ({result.end.value}): done is None after reset.")
    if result.ticks > _TICKS:
        return Check("end", False, f"the episode took {result.ticks} ticks under a tick_cap of {_TICKS}.")
    problem = _two_ends(simulator, result)
    if problem is not None:
        return Check("end", False, problem)
    if not 0.0 <= result.route_completion_pct <= 100.0:
        return Check("end", False, f"route_completion_pct is {result.route_completion_pct!r}, expected 0..100.")
    return Check("end", True, f"the episode ends after {result.ticks} ticks: {result.end.value}.")


def _two_ends(simulator: Simulator, result: EpisodeResult) -> str | None:
    """Return a sentence if `done` and `score()` disagree about the end, or None."""
    done = simulator.done
    if done is result.end:
        return None
    return f"done is {done!r}, but score() has the end {result.end!r}: both say why the episode is over."


def _plan(plan: object) -> Check:
    """Check the plan that `Agent.reset` gets: the agent would be blamed for a plan that nobody can follow."""
    if not isinstance(plan, GlobalPlan):
        return Check("plan", False, f"plan gave {plan!r}, expected a GlobalPlan.")
    if not plan.points:
        return Check("plan", False, "plan gave no points, expected those of the route.")
    for point in (*plan.points, *plan.dense):
        if not isinstance(point, PlanPoint) or not (math.isfinite(point.x_m) and math.isfinite(point.y_m)):
            return Check("plan", False, f"plan gave {point!r}, expected a PlanPoint with finite x_m and y_m.")
        if not isinstance(point.command, RoadOption):
            return Check("plan", False, f"plan gave the command {point.command!r}, expected a RoadOption.")
    return Check("plan", True, f"the agent is given {len(plan.points)} points of the route.")


def _versions(simulator: Simulator) -> Check:
    versions: object = simulator.versions()
    if not isinstance(versions, Mapping):
        return Check("versions", False, f"versions gave {versions!r}, expected names with their versions.")
    for name, version in versions.items():
        if not (isinstance(name, str) and isinstance(version, str)):
            return Check("versions", False, f"versions has {name!r}: {version!r}, expected text for text.")
    return Check("versions", True, f"{', '.join(versions) or 'nothing'} decides the numbers.")


def _stamps(observations: list[Observation], dt_s: float) -> Check:
    for tick, seen in enumerate(observations):
        ego_ticks = {seen.tick, seen.gps.tick, seen.compass.tick, seen.imu.tick, seen.speed.tick}
        if ego_ticks != {tick}:
            return Check("stamps", False, f"in tick {tick}, GPS, compass, IMU and speed are of {sorted(ego_ticks)}.")
        for camera in _cameras(dt_s):
            period = round(1.0 / (dt_s * camera.rate_hz))
            expected, image = tick - tick % period, seen.cameras.get(camera.name)
            if image is not None and (stamped := image.tick) != expected:
                told = f"tick {tick}: {camera.name} at {camera.rate_hz:g} Hz is stamped {stamped}"
                return Check("stamps", False, f"{told}, expected {expected}.")
    return Check("stamps", True, "every signal carries the tick of its capture, images at their own rate.")


def _truth(simulator: Simulator, route: Route, seed: int) -> Check:
    try:
        before = simulator.reset(route, seed=seed, cameras=_cameras(simulator.dt_s))
        observation, truth = simulator.observe(), simulator.truth()
        after = simulator.step(Control.NEUTRAL)
    except BLAMED as error:
        return Check("truth", False, f"{blame(_OURS, error)}.")
    if not isinstance(truth, GroundTruth):
        return Check("truth", False, f"truth gave {truth!r}, expected a GroundTruth.")
    if observation.truth is not None:
        return Check("truth", False, "observe gives the ground truth away: leave truth out.")
    if (before.tick, truth.state.tick, after.tick) != (0, 0, 1):
        told = f"reset, truth and step give states of ticks {before.tick}, {truth.state.tick} and {after.tick}"
        return Check("truth", False, f"{told}, expected 0, 0 and 1.")
    return Check("truth", True, "observe leaves the ground truth out, and states count from 0.")


def _states(simulator: Simulator, route: Route, seed: int) -> Check:
    """Check that later ticks do not change a state: a state is recorded, drawn and judged after the next step."""
    states = [simulator.reset(route, seed=seed, cameras=())]
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
                return Check("states", False, f"{told}: give each state arrays of its own.")
    return Check("states", True, "a state stays as it is while the world goes on.")


def _stuck(factory: Callable[[SimulatorOptions], Simulator], dt_s: float, route: Route, seed: int) -> Check:
    simulator = factory(SimulatorOptions(tick_cap=round(_BRAKED_S / float(dt_s)), stuck_stop_s=_STUCK_S))
    _, result = drive(ScriptedAgent([Control(brake=1.0)]), simulator, route=route, seed=seed)
    problem = _two_ends(simulator, result)
    simulator.close()
    if result.outcome is Outcome.INFRA_ERROR:
        return Check("stuck", False, f"an ego that brakes: tick {result.ticks}: {result.end_detail}.")
    if problem is not None:
        return Check("stuck", False, f"an ego that brakes: {problem}")
    if result.end is End.STUCK:
        return Check("stuck", True, f"the episode ends once the ego stood for {_STUCK_S:g} s.")
    moved = np.flatnonzero(np.abs(result.trace.column("speed_mps")) >= _STILL_MPS)
    stood_s = (result.ticks - (moved[-1] + 1 if len(moved) else 0)) * float(dt_s)
    if stood_s >= 2.0 * _STUCK_S:
        told = (
            f"the ego stood for {stood_s:g} s under a stuck_stop_s of {_STUCK_S:g}, and the end is {result.end.value}"
        )
        return Check("stuck", False, f"{told}: end such an episode with End.STUCK.")
    return Check("stuck", True, "not tried: an ego that brakes does not stand long enough here.")


def _isolation(simulator: Simulator, route: Route, seed: int, record: RecordingAgent) -> Check:
    """Check that an agent that paints over its images sees the same world as one that does not."""
    script = iter(record.controls)

    def scribble(observation: Observation) -> Control:
        for image in observation.cameras.values():
            image.pixels[:] = 255
        return next(script)

    painted, _ = drive(ScriptedAgent(scribble, cameras=_cameras(simulator.dt_s)), simulator, route=route, seed=seed)
    tick = first_difference_seen(record.observations, painted.observations)
    if tick is not None:
        return Check("isolation", False, f"writing to an image changes what is seen in tick {tick}.")
    return Check("isolation", True, "writing to an image changes nothing in later ticks.")


def _globals(
    simulator: Simulator,
    factory: Callable[[SimulatorOptions], Simulator],
    route: Route,
    seed: int,
    record: RecordingAgent,
) -> Check:
    """Check that a world shares nothing with an agent that draws from global generators, nor with a world beside it."""
    beside = factory(SimulatorOptions(tick_cap=_TICKS))
    script = iter(record.controls)

    def draw(observation: Observation) -> Control:
        random.random()
        np.random.random()
        if beside.done is None:
            beside.observe()
            beside.step(Control.NEUTRAL)
        return next(script)

    with borrowed_generators("check_simulator"):
        beside.reset(route, seed=seed + 1, cameras=())
        shared, _ = drive(ScriptedAgent(draw, cameras=_cameras(simulator.dt_s)), simulator, route=route, seed=seed)
    beside.close()
    tick = first_difference_seen(record.observations, shared.observations)
    if tick is not None:
        told = f"draws from global generators, or a world beside this one, change what is seen in tick {tick}"
        return Check("globals", False, f"{told}: draw from a generator of the object, and keep all state in it.")
    return Check("globals", True, "neither draws from global generators nor a world beside this one reach it.")


def _determinism(factory: Callable[[SimulatorOptions], Simulator], route: Route, seed: int, first: _Driven) -> Check:
    fresh = factory(SimulatorOptions(tick_cap=_TICKS))
    difference = _difference(first, _scripted(fresh, route, seed))
    fresh.close()
    if difference is not None:
        return Check("determinism", False, f"a new world with the same route and seed {difference}.")
    return Check("determinism", True, "a new world with the same route and seed is the same to the bit.")


def _reset(simulator: Simulator, route: Route, seed: int, first: _Driven) -> Check:
    difference = _difference(first, _scripted(simulator, route, seed))
    if difference is not None:
        told = f"after other episodes, the same route and seed {difference}"
        return Check("reset", False, f"{told}: build in reset all that an episode changes.")
    return Check("reset", True, "nothing is left of the last episode.")


def _difference(first: _Driven, again: _Driven) -> str | None:
    """Return in a clause how a second drive of the episode differs, or None when both are the same to the bit."""
    (record, result), (other_record, other) = first, again
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


def _close(simulator: Simulator) -> Check:
    try:
        simulator.close()
        simulator.close()
    except BLAMED as error:
        return Check("close", False, f"{blame('close', error)}.")
    return Check("close", True, "closing twice does no harm.")
