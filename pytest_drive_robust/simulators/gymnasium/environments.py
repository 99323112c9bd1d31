"""Make a drivable environment: 20 Hz, two actions, no observation, no reward, isolated class attributes."""

from __future__ import annotations

import copy
import functools
import importlib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import gymnasium
import highway_env
import highway_env.vehicle.behavior
import highway_env.vehicle.dynamics  # noqa: F401 -- classes must exist before they can be watched
import numpy as np
from gymnasium.envs.registration import EnvSpec, load_env_creator
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.vehicle.objects import RoadObject

from pytest_drive_robust.domain.route import Route, ScenarioSpec, TriggerPoint
from pytest_drive_robust.errors import RouteError, UnknownNameError, UsageError
from pytest_drive_robust.simulators.gymnasium.live_road import ACCELERATION_RANGE_MPS2, STEERING_RANGE_RAD, EgoAction

Environment = gymnasium.Env[Any, Any]

RATE_HZ = 20
_CONFIG: Mapping[str, object] = {
    "simulation_frequency": RATE_HZ,
    "policy_frequency": RATE_HZ,
    "observation": {"type": "AttributesObservation", "attributes": []},
    "action": {
        "type": "ContinuousAction",
        "acceleration_range": list(ACCELERATION_RANGE_MPS2),
        "steering_range": list(STEERING_RANGE_RAD),
    },
    "duration": math.inf,
}
"""The configuration forced on every environment.

* One simulation step per decision, 20 of each per second. An environment computes `simulation_frequency //
  policy_frequency` frames per decision, so 15 and 20 would give no frame, and 50 and 20 two frames of 20 ms per 50 ms.
* No observation: highway-env's `Kinematics` goes through pandas and costs half of a step.
* No `duration`: the horizon of a learning problem, within which a careful driver may not arrive. `tick_cap` ends
  episodes.
"""
_EXPECTED = (
    "expected an environment like highway-env's: unwrapped it has `road` (network, vehicles, objects), `vehicle`, "
    "`config` and `action_type`, and `gymnasium.make(id, config={...})` sets its config"
)
ROUTES = 10
"""Number of routes that are driven when no route is named."""
_MOST_ROUTES = 100_000
WORKING = (
    *("exit-v0", "exit-v1", "highway-v0", "highway-fast-v0", "intersection-v0", "intersection-v1", "intersection-v2"),
    *("merge-v0", "merge-v1", "merge-generic-v0", "merge-generic-v1", "racetrack-v0", "racetrack-v1"),
    *("racetrack-large-v0", "racetrack-large-v1", "racetrack-oval-v0", "racetrack-oval-v1", "roundabout-v0"),
    *("roundabout-v1", "roundabout-generic-v0", "roundabout-generic-v1", "two-way-v0", "u-turn-v0", "u-turn-v1"),
)
_PARKING = "it has no lane to drive along and needs a reverse gear, which throttle, steer and brake do not have"
_SEVERAL = "it has several egos, and here one agent drives one"
_OWN_STEP = "it steers a car of constant speed by a step of its own, without traffic"
_REFUSED = {
    "intersection-multi-agent-v0": (_SEVERAL, "intersection-v0"),
    "intersection-multi-agent-v1": (_SEVERAL, "intersection-v1"),
    "intersection-multi-agent-v2": (_SEVERAL, "intersection-v2"),
    "lane-keeping-v0": (_OWN_STEP, "racetrack-v0"),
    "parking-v0": (_PARKING, "roundabout-v0"),
    "parking-ActionRepeat-v0": (_PARKING, "roundabout-v0"),
    "parking-parked-v0": (_PARKING, "roundabout-v0"),
}
"""By refused environment: the reason, and the nearest drivable environment."""


class DrivableEnvironment:
    """A mix-in for an environment's class, before its own methods.

    No reward is computed: nobody reads the reward, and merge, roundabout and two-way raise for continuous actions.
    """

    def define_spaces(self) -> None:
        """Define the environment's spaces, with our own class of the ego."""
        super().define_spaces()  # type: ignore[misc]
        self.action_type = EgoAction(self, **self.config["action"])  # type: ignore[attr-defined]
        self.action_space = self.action_type.space()

    def _reward(self, action: object) -> float:
        return 0.0

    def _rewards(self, action: object) -> dict[str, float]:
        return {}


def find_spec(identifier: str) -> EnvSpec:
    """Return the registered environment of that id, or of `"module:id"` after importing the module.

    Raises `UnknownNameError` for an unregistered environment, `UsageError` for an environment that we refuse.
    """
    module, _, name = identifier.rpartition(":")
    if module:
        try:
            importlib.import_module(module)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an import may also call sys.exit() or pytest.skip()
            what = f"the module {module!r} of gymnasium:{identifier}"
            raise UsageError(f"{what} does not load: {type(error).__name__}: {error}.") from error
    if name in _REFUSED:
        reason, instead = _REFUSED[name]
        raise UsageError(
            f"gymnasium:{name} cannot be driven: {reason}. The nearest is gymnasium:{instead}. "
            f"With gymnasium: {', '.join(WORKING)}."
        )
    try:
        return gymnasium.spec(name)
    except gymnasium.error.Error:
        hint = "Give 'gymnasium:module:ID' for one that a module of yours registers."
        raise UnknownNameError.of("gymnasium environment", identifier, WORKING, hint=hint) from None


def make_environment(spec: EnvSpec, *, name: str) -> Environment:
    """Return an environment at 20 Hz, `name` for messages. Raises `UsageError` for one unlike highway-env's."""
    spec = copy.deepcopy(spec)
    creator = load_env_creator(spec.entry_point) if isinstance(spec.entry_point, str) else spec.entry_point
    if isinstance(creator, type) and issubclass(creator, AbstractEnv):
        spec.entry_point = _drivable(creator)
    try:
        env: Environment = gymnasium.make(spec, max_episode_steps=-1, disable_env_checker=True, config=dict(_CONFIG))
    except Exception as error:  # whatever a stranger's constructor raises
        reason = str(error).partition(" was raised from the environment creator")[0]  # what follows is our config
        raise UsageError(f"{name} cannot be made: {type(error).__name__}: {reason}; {_EXPECTED}.") from error
    _check(env.unwrapped, name)
    return env


def _check(env: Any, name: str) -> None:
    lacking = [part for part in ("road", "vehicle", "config", "action_type") if getattr(env, part, None) is None]
    if not lacking:
        lacking = [f"road.{part}" for part in ("network", "vehicles", "objects") if not hasattr(env.road, part)]
    if lacking:
        raise UsageError(f"{name} has no {', '.join(lacking)}: {_EXPECTED}.")
    rates = [env.config.get(rate) for rate in ("simulation_frequency", "policy_frequency")]
    if rates != [RATE_HZ, RATE_HZ]:
        raise UsageError(
            f"{name} runs at simulation_frequency {rates[0]} and policy_frequency {rates[1]}, expected {RATE_HZ} "
            f"and {RATE_HZ}: with another ratio its clock and its motion disagree. It overrides the config it is given."
        )
    ranged = all(hasattr(env.action_type, limits) for limits in ("acceleration_range", "steering_range"))
    if not ranged or np.shape(env.action_space.sample()) != (2,):
        raise UsageError(
            f"{name} has the actions {env.action_space}, expected highway-env's ContinuousAction of two numbers, "
            "acceleration and steering."
        )


@functools.cache
def _drivable(creator: type) -> type:
    return type(f"Drivable{creator.__name__}", (DrivableEnvironment, creator), {"__module__": __name__})


def routes_of(simulator: str, identifier: str, names: Sequence[str] = ()) -> tuple[Route, ...]:
    """Return the routes of the given names, each once; without names the first `ROUTES`, `ID-0` to `ID-9`.

    A route has no waypoints, because its way is known only after the reset. Raises `UnknownNameError`.
    """
    wanted = names or [f"{identifier}-{number}" for number in range(ROUTES)]
    for name in wanted:
        if _number(name, identifier) is None:
            known = [f"{identifier}-{number}" for number in range(ROUTES)]
            hint = f"Any number up to {_MOST_ROUTES - 1} will do."
            raise UnknownNameError.of(f"route of {simulator}", name, known, hint=hint)
    scenario = ScenarioSpec(identifier, identifier, TriggerPoint(0.0, 0.0, 0.0, 0.0))
    return tuple(Route(name, simulator, (), scenario) for name in dict.fromkeys(wanted))


def reset_seed(route: Route, seed: int, *, simulator: str, identifier: str) -> int:
    """Return the reset's seed: the route's number + 100000 times the episode's. Raises `RouteError` for another."""
    number = _number(route.id, identifier)
    if number is None:
        raise RouteError(
            f"route {route.label!r} is for town {route.town!r} and does not fit {simulator}, which makes its own "
            f"roads: give --drive-routes {simulator} for its first {ROUTES} routes, or some of {identifier}-0 to "
            f"{identifier}-{_MOST_ROUTES - 1} by name"
        )
    return number + _MOST_ROUTES * seed


def _number(name: str, identifier: str) -> int | None:
    found = re.fullmatch(re.escape(identifier) + r"-(0|[1-9]\d{0,4})", name)
    return None if found is None else int(found.group(1))


Values = Mapping[type, Mapping[str, object]]


class ClassAttributes:
    """One environment's own values of class attributes in one episode, in force only while its code runs.

    `IntersectionEnv` sets `IDMVehicle.DISTANCE_WANTED`, `COMFORT_ACC_MAX` and `COMFORT_ACC_MIN` on the class and never
    puts them back: every later environment of the process would drive other trajectories for the same seed.

    >>> from highway_env.vehicle.behavior import IDMVehicle
    >>> own, before = ClassAttributes(), IDMVehicle.DISTANCE_WANTED
    >>> with own.inside():
    ...     IDMVehicle.DISTANCE_WANTED = 7
    >>> IDMVehicle.DISTANCE_WANTED == before
    True
    """

    def __init__(self) -> None:
        self._own: Values = {}

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Run the environment's code with its own values; restore the outer values afterwards, also on an error."""
        outside = _snapshot()
        _write(self._own)
        try:
            yield
        finally:
            self._own = _snapshot()
            _write(outside)


def _snapshot() -> Values:
    """Return by class the plain attributes that `RoadObject` and each of its subclasses define."""
    family: list[type] = [RoadObject]
    for cls in family:  # the list grows during the loop
        children: list[type] = cls.__subclasses__()
        family.extend(child for child in children if child not in family)
    return {cls: _plain(cls) for cls in family}


def _plain(cls: type) -> dict[str, object]:
    """Return the plain values of a class: numbers, texts, lists, but no method, property or dunder."""
    values = vars(cls).items()
    return {k: v for k, v in values if not (k.startswith("__") or callable(v) or hasattr(v, "__get__"))}


def _write(values: Values) -> None:
    for cls, attributes in values.items():
        for name in _plain(cls).keys() - attributes.keys():
            delattr(cls, name)
        for name, value in attributes.items():
            if vars(cls).get(name, values) is not value:
                setattr(cls, name, value)
