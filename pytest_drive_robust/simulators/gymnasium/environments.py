"""Find a registered environment and make it drivable: 20 Hz, two actions, no observation, no reward."""

from __future__ import annotations

import copy
import functools
import importlib
import math
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec, load_env_creator
from highway_env.envs.common.abstract import AbstractEnv

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.simulators.gymnasium.ego import ACCELERATION_RANGE_MPS2, STEERING_RANGE_RAD, EgoAction

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
