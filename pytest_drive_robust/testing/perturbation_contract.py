"""Does a perturbation keep the contract of `pytest_drive_robust.Perturbation`?"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.errors import PerturbationError, UsageError, did_you_mean, nearest
from pytest_drive_robust.perturbations.base import Perturbation, Setting, check_severities_are_fields
from pytest_drive_robust.perturbations.context import EpisodeContext
from pytest_drive_robust.perturbations.sentence_checks import check_sentences
from pytest_drive_robust.perturbations.sentence_forms import kebab_name
from pytest_drive_robust.perturbations.stack import inference_problem, observation_problem
from pytest_drive_robust.runner.episode.contract import BLAMED, blame
from pytest_drive_robust.testing.driving import first_difference, first_difference_seen, observation_digest
from pytest_drive_robust.testing.fake_simulator import FakeSimulator, fake_route
from pytest_drive_robust.testing.report import Broken, Check, ContractReport, attempt

_OURS = "the perturbation"
_TICKS = 80
_DT_S = 0.05
_HELD_TICKS = 4
_ACT_S, _SLOW_ACT_S = 0.01, 1.0
_SEAMS = ("observe", "wants_inference", "actuate")
_CAMERAS = (CameraSpec("front", width_px=32, height_px=18), CameraSpec("rear", width_px=24, height_px=16, rate_hz=10.0))


def check_perturbation(perturbation: Perturbation, *, seed: int = 0) -> ContractReport:
    """Run 80 ticks of a recorded drive through the perturbation and report which promises hold. Raises nothing."""
    return ContractReport(type(perturbation).__name__, tuple(_checks(perturbation, seed)))


def _checks(perturbation: Perturbation, seed: int) -> Iterator[Check]:
    yield (declared := attempt(_OURS, _class, perturbation))
    if not declared.ok:
        return
    yield attempt(_OURS, _sentence, perturbation)
    clean = _clean_drive(seed)
    before = [observation_digest(observation) for observation in clean]
    try:
        done = _episode(perturbation, clean, seed)
    except BLAMED as error:
        yield Check("drives", False, f"{blame(_OURS, error)}.")
        return
    try:
        seldom = _episode(perturbation, clean, seed, every=_HELD_TICKS)
    except BLAMED as error:
        told = f"where the agent is not asked, as under a latency that holds, {blame(_OURS, error)}"
        yield Check("drives", False, f"{told}: actuate gets control=None then, and may pass it on.")
        seldom = done
    else:
        yield Check("drives", True, f"{len(done.applied)} ticks on both seams, without an error.")
    yield attempt(_OURS, _isolation, before, clean)
    yield (observations := attempt(_OURS, _observations, clean, done.seen))
    yield attempt(_OURS, _inference, done)
    yield (controls := attempt(_OURS, _controls, [*done.applied, *seldom.applied], done.answered))
    yield (schedule := attempt(_OURS, _schedule, done))
    if schedule.ok:
        yield attempt(_OURS, _seams, type(perturbation))
    if observations.ok and controls.ok:
        yield attempt(_OURS, _determinism, perturbation, clean, seed, done)


def _class(perturbation: Perturbation) -> str:
    kind = type(perturbation)
    if isinstance(perturbation, type):
        raise Broken(f"{perturbation.__name__} is a class, expected an object of it: add the brackets.")
    if not isinstance(perturbation, Perturbation):
        raise Broken(f"{kind.__name__} does not inherit from Perturbation.")
    if "__dataclass_fields__" not in vars(kind):
        raise Broken(f"{kind.__name__} is not a dataclass: write @dataclass above the class.")
    try:
        check_severities_are_fields(kind)
    except PerturbationError as error:
        raise Broken(f"{error}") from None
    if not kind.phrase:
        told = f"{kind.__name__} has no phrase, so that requirements call it {str(perturbation)!r}"
        raise Broken(f"{told}: give it one, with its severities in braces.")
    return "it is a dataclass with a phrase."


def _seams(kind: type[Perturbation]) -> str:
    changed = [name for name in _SEAMS if getattr(kind, name) is not getattr(Perturbation, name)]
    if changed:
        return f"it has {' and '.join(changed)}."
    hint = next((did_you_mean(name, _SEAMS) for name in vars(kind) if nearest(name, _SEAMS)), "")
    raise Broken(f"{kind.__name__} changes nothing: it has none of {', '.join(_SEAMS)}.{hint}")


def _sentence(perturbation: Perturbation) -> str:
    try:
        check_sentences(type(perturbation), ())
        sentence = str(Setting.of(perturbation))
        parsed = Setting.parse(sentence, {"under test": type(perturbation)})
    except UsageError as error:
        raise Broken(f"{error}") from None
    if parsed != Setting.of(perturbation):
        advice = "show every severity in the phrase by its exact value"
        raise Broken(f"{sentence!r} is read back as {str(parsed)!r}: {advice}.")
    return f"{sentence!r} is read back as the same setting."


def _clean_drive(seed: int) -> list[Observation]:
    """Return the observations of a slowly weaving ego, `_TICKS` of them, each with arrays of its own."""
    simulator = FakeSimulator()
    simulator.reset(fake_route(), seed=seed, cameras=_CAMERAS)
    observations = []
    for tick in range(_TICKS):
        observations.append(simulator.observe().private())
        simulator.step(_wanted(tick))
    return observations


def _wanted(tick: int) -> Control:
    """Return a control that is different in every tick, so that delays and mix-ups show."""
    return Control(throttle=0.3 + 0.5 * tick / _TICKS, steer=0.1 - 0.2 * tick / _TICKS)


@dataclass
class _Drive:
    """The results of both seams for a recorded drive, tick by tick, and the schedule of the perturbation."""

    seen: list[Observation] = field(default_factory=list)
    wanted: list[object] = field(default_factory=list)
    answered: list[Control | None] = field(default_factory=list)  # what `actuate` gave where it got a control
    applied: list[Control] = field(default_factory=list)
    schedule: object = ()


def _episode(
    perturbation: Perturbation, clean: list[Observation], seed: int, *, every: int = 1, act_s: float = _ACT_S
) -> _Drive:
    """Return the recorded drive under the perturbation.

    The agent runs in every tick that is a multiple of `every`, unless the perturbation keeps the agent's computer busy,
    and needs `act_s` seconds for each control.
    """
    own = copy.deepcopy(perturbation)
    own.reset(EpisodeContext("1", seed, _DT_S, _CAMERAS, kebab_name(type(own))))
    done, last = _Drive(), Control.NEUTRAL
    for tick, observation in enumerate(clean):
        done.seen.append(own.observe(observation))  # no `RunningStack`, which would raise for what is checked here
        done.wanted.append(own.wants_inference(tick))
        asked = bool(done.wanted[-1]) and tick % every == 0
        given = own.actuate(tick, _wanted(tick) if asked else None, act_s if asked else 0.0)
        if asked:
            done.answered.append(given)
        last = last if given is None else given
        done.applied.append(last)
    done.schedule = own.schedule()
    return done


def _isolation(before: list[str], clean: list[Observation]) -> str:
    tick = first_difference(before, [observation_digest(observation) for observation in clean])
    if tick is not None:
        raise Broken(f"observe wrote into the observation of tick {tick}: work on a copy.")
    return "observe leaves its argument as it was."


def _observations(clean: list[Observation], seen: list[Observation]) -> str:
    for tick, (given, got) in enumerate(zip(clean, seen, strict=True)):
        problem = observation_problem(given, got)
        if problem is not None:
            raise Broken(f"tick {tick}: observe {problem}.")
    return "every image keeps its shape and type, every signal is finite."


def _inference(done: _Drive) -> str:
    for tick, wanted in enumerate(done.wanted):
        problem = inference_problem(wanted)
        if problem is not None:
            raise Broken(f"tick {tick}: wants_inference {problem}")
    return f"the agent may be asked in {sum(map(bool, done.wanted))} of {_TICKS} ticks."


def _schedule(done: _Drive) -> str:
    given = done.schedule
    if not isinstance(given, Iterable):
        raise Broken(f"schedule gave {given!r}, expected a tuple of Injection objects.")
    injections = tuple(given)
    for item in injections:
        if not isinstance(item, Injection):
            raise Broken(f"schedule gave {item!r}, expected Injection objects.")
    return f"{len(injections)} injections are noted for the record."


def _controls(applied: list[Control], answered: list[Control | None]) -> str:
    for tick, control in enumerate(applied):
        problem = control.problem() if isinstance(control, Control) else f"{control!r} is not a Control"
        if problem is not None:
            raise Broken(f"tick {tick}: {problem}.")
    if answered and not any(answered):  # in a run this is a link that drops every command
        told = f"actuate gave None in all {len(answered)} ticks in which it got a control"
        raise Broken(f"{told}: is there a return in every branch?")
    return "every control is within its ranges."


def _determinism(perturbation: Perturbation, clean: list[Observation], seed: int, done: _Drive) -> str:
    _episode(perturbation, clean, seed + 1)  # an episode in between must leave no trace
    tick = _first_difference(done, _episode(perturbation, clean, seed))
    if tick is not None:
        advice = "draw from (seed, route, stream, sensor, tick) only, and keep no state but what reset builds"
        raise Broken(f"the same episode differs from tick {tick} on: {advice}.")
    if not getattr(perturbation, "measures_inference", False):
        tick = _first_difference(done, _episode(perturbation, clean, seed, act_s=_SLOW_ACT_S))
        if tick is not None:
            told = f"the same episode differs from tick {tick} on where act takes longer"
            raise Broken(f"{told}: decide nothing by inference_s, which is never the same twice.")
    return "the same episode is perturbed the same, whatever was driven before."


def _first_difference(one: _Drive, other: _Drive) -> int | None:
    """Return the first tick in which the observations differ, else in which the controls differ, or None."""
    tick = first_difference_seen(one.seen, other.seen)
    return first_difference(one.applied, other.applied) if tick is None else tick
