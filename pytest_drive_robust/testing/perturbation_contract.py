"""Does a perturbation keep the contract of `pytest_drive_robust.Perturbation`?"""

from __future__ import annotations

from collections.abc import Iterator

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.runner.episode.contract import blame
from pytest_drive_robust.testing.driving import first_difference, observation_digest
from pytest_drive_robust.testing.fake_simulator import FakeSimulator, fake_route
from pytest_drive_robust.testing.report import Check, ContractReport

_TICKS = 80
_CAMERAS = (CameraSpec("front", width_px=32, height_px=18), CameraSpec("rear", width_px=24, height_px=16, rate_hz=10.0))


def check_perturbation(perturbation: Perturbation, *, seed: int = 0) -> ContractReport:
    """Run 80 ticks of a recorded drive through the perturbation and tell which promises hold. Raises nothing."""
    return ContractReport(type(perturbation).__name__, tuple(_checks(perturbation, seed)))


def _checks(perturbation: Perturbation, seed: int) -> Iterator[Check]:
    yield (declared := _declared(perturbation))
    if not declared.ok:
        return
    yield _sentence(perturbation)
    clean = _clean_drive(seed)
    before = [observation_digest(observation) for observation in clean]
    try:
        seen, applied = _episode(perturbation, clean, seed)
    except Exception as error:
        yield Check("drives", False, f"{blame('the perturbation', error)}.")
        return
    yield Check("drives", True, f"{len(applied)} ticks on both seams, without an error.")
    yield _isolation(before, clean)
    yield _observations(clean, seen)
    yield _controls(applied)
    yield _determinism(perturbation, clean, seed, seen, applied)


def _declared(perturbation: Perturbation) -> Check:
    kind = type(perturbation)
    if not isinstance(perturbation, Perturbation):
        return Check("class", False, f"{kind.__name__} does not inherit from Perturbation.")
    if "__dataclass_fields__" not in vars(kind):
        return Check("class", False, f"{kind.__name__} is not a dataclass: write @dataclass above the class.")
    if not kind.phrase:
        return Check("class", False, f"{kind.__name__} has no phrase: no requirement could name it.")
    return Check("class", True, "it is a dataclass with a phrase.")


def _sentence(perturbation: Perturbation) -> Check:
    try:
        sentence = str(Setting.of(perturbation))
        parsed = Setting.parse(sentence, {"under test": type(perturbation)})
    except UsageError as error:
        return Check("sentence", False, f"{error}")
    if parsed != Setting.of(perturbation):
        advice = "show every severity in the phrase by its exact value"
        return Check("sentence", False, f"{sentence!r} is read back as {str(parsed)!r}: {advice}.")
    return Check("sentence", True, f"{sentence!r} is read back as the same setting.")


def _clean_drive(seed: int) -> list[Observation]:
    """Return what the sensors of a slowly weaving ego give, in arrays of its own."""
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


def _episode(
    perturbation: Perturbation, clean: list[Observation], seed: int
) -> tuple[list[Observation], list[Control]]:
    """Return what comes out of both seams for a recorded drive."""
    stack = Setting.of(perturbation).start(route_id="1", seed=seed, dt_s=0.05, cameras=_CAMERAS)
    seen, applied = [], []
    for tick, observation in enumerate(clean):
        seen.append(stack.observe(observation))
        asked = stack.wants_inference(tick)
        applied.append(stack.actuate(tick, _wanted(tick) if asked else None, 0.01 if asked else 0.0))
    return seen, applied


def _isolation(before: list[str], clean: list[Observation]) -> Check:
    tick = first_difference(before, [observation_digest(observation) for observation in clean])
    if tick is not None:
        return Check("isolation", False, f"observe wrote into the observation of tick {tick}: work on a copy.")
    return Check("isolation", True, "observe leaves its argument as it was.")


def _observations(clean: list[Observation], seen: list[Observation]) -> Check:
    for tick, (given, got) in enumerate(zip(clean, seen, strict=True)):
        if not isinstance(got, Observation):
            return Check("observations", False, f"tick {tick}: observe gave {got!r}, expected an Observation.")
        if set(got.cameras) != set(given.cameras):
            return Check("observations", False, f"tick {tick}: the cameras became {', '.join(got.cameras) or 'none'}.")
        for name, image in got.cameras.items():
            expected, pixels = given.cameras[name].pixels, image.pixels
            if pixels.shape != expected.shape or pixels.dtype != expected.dtype:
                change = f"{expected.shape} {expected.dtype} to {pixels.shape} {pixels.dtype}"
                return Check("observations", False, f"tick {tick}: {name} went from {change}.")
    return Check("observations", True, "every image keeps its shape and type.")


def _controls(applied: list[Control]) -> Check:
    for tick, control in enumerate(applied):
        problem = control.problem() if isinstance(control, Control) else f"{control!r} is not a Control"
        if problem is not None:
            return Check("controls", False, f"tick {tick}: {problem}.")
    return Check("controls", True, "every control is within its ranges.")


def _determinism(
    perturbation: Perturbation, clean: list[Observation], seed: int, seen: list[Observation], applied: list[Control]
) -> Check:
    _episode(perturbation, clean, seed + 1)  # an episode in between must leave no trace
    seen_again, applied_again = _episode(perturbation, clean, seed)
    digests = [observation_digest(observation) for observation in seen]
    tick = first_difference(digests, [observation_digest(observation) for observation in seen_again])
    if tick is None:
        tick = first_difference(applied, applied_again)
    if tick is not None:
        advice = "draw from (seed, route, stream, sensor, tick) only, and keep no state but what reset builds"
        return Check("determinism", False, f"the same episode differs from tick {tick} on: {advice}.")
    return Check("determinism", True, "the same episode is perturbed the same, whatever was driven before.")
