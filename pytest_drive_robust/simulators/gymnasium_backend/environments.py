"""Making an environment that we can drive: 20 Hz, two continuous actions, no observation, no reward."""

from __future__ import annotations

import copy
import functools
import importlib
import math
from collections.abc import Mapping
from typing import Any

import gymnasium
import highway_env  # noqa: F401 -- registers its ids
import numpy as np
from gymnasium.envs.registration import EnvSpec, load_env_creator
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.envs.common.action import ContinuousAction

from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.simulators.gymnasium_backend.ids import refusal_of, working_ids
from pytest_drive_robust.simulators.gymnasium_backend.vehicles import (
    ACCELERATION_RANGE_MPS2,
    STEERING_RANGE_RAD,
    EgoVehicle,
)

__all__ = ["RATE_HZ", "check_environment", "find_spec", "make_environment"]

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
"""What is forced on every environment.

* One simulation step per decision, 20 of each in a second: `simulation_frequency // policy_frequency` frames are
  computed, so 15 and 20 would mean none at all and 50 and 20 would mean 2 of 20 ms in each 50 ms.
* No observation: highway-env's `Kinematics` goes through pandas and costs half of a step.
* No `duration`: the horizon of a learning problem, in which a careful driver does not arrive. `tick_cap` ends episodes.
"""
_EXPECTED = (
    "expected an environment like highway-env's: its unwrapped `road` (network, vehicles, objects), `vehicle`, "
    "`config` and `action_type`, and `make(id, config={...})`"
)


class EgoAction(ContinuousAction):
    """highway-env's continuous action for an ego of our class."""

    @property
    def vehicle_class(self) -> type[EgoVehicle]:
        """Whom environments put on the road as the ego."""
        return EgoVehicle


class Driven:
    """Mixed into an environment's class before its own methods.

    Nobody reads the reward, so none is computed: those of merge, roundabout and two-way raise for continuous actions.
    """

    action_class: type[ContinuousAction] = EgoAction

    def define_spaces(self) -> None:
        """The environment's spaces, with our own class of the ego."""
        super().define_spaces()  # type: ignore[misc]
        self.action_type = self.action_class(self, **self.config["action"])  # type: ignore[attr-defined]
        self.action_space = self.action_type.space()

    def _reward(self, action: object) -> float:
        return 0.0

    def _rewards(self, action: object) -> dict[str, float]:
        return {}


def find_spec(identifier: str, *, simulator: str = "gymnasium") -> EnvSpec:
    """The registered environment of that id, or of `"module:id"` after importing the module.

    Raises `UnknownNameError` for one that nobody registered, `UsageError` for one that we refuse.
    """
    module, colon, name = identifier.rpartition(":")
    if colon:
        try:
            importlib.import_module(module)
        except ImportError as error:
            raise UsageError(f"the module {module!r} of the gymnasium id {identifier!r} does not load: {error}") from error
    reason = refusal_of(name, simulator=simulator)
    if reason is not None:
        raise UsageError(reason)
    try:
        return gymnasium.spec(name)
    except gymnasium.error.Error:
        hint = "Give 'gymnasium:module:ID' for one that a module of yours registers."
        raise UnknownNameError.of("gymnasium environment", identifier, working_ids(), hint=hint) from None


def make_environment(
    spec: EnvSpec, *, simulator: str = "gymnasium", mixin: type = Driven
) -> gymnasium.Env[Any, Any]:
    """A new environment, at 20 Hz. Raises `UsageError` when it cannot be made so or is not like highway-env's."""
    spec = copy.deepcopy(spec)
    creator = spec.entry_point if callable(spec.entry_point) else load_env_creator(str(spec.entry_point))
    if isinstance(creator, type) and issubclass(creator, AbstractEnv):
        spec.entry_point = _driven(creator, mixin)
    try:
        env = gymnasium.make(spec, max_episode_steps=-1, disable_env_checker=True, config=dict(_CONFIG))
    except Exception as error:  # whatever a stranger's constructor raises
        raise UsageError(
            f"gymnasium:{spec.id} cannot be made: {type(error).__name__}: {error}; {_EXPECTED}."
        ) from error
    check_environment(env, spec.id)
    return env


def check_environment(env: gymnasium.Env[Any, Any], identifier: str) -> None:
    """Raise `UsageError` when we cannot drive this environment, with what was expected."""
    inner = env.unwrapped
    lacking = [name for name in ("road", "vehicle", "config", "action_type") if getattr(inner, name, None) is None]
    if not lacking:
        lacking = [f"road.{name}" for name in ("network", "vehicles", "objects") if not hasattr(inner.road, name)]  # type: ignore[attr-defined]
    if lacking:
        raise UsageError(f"gymnasium:{identifier} has no {', '.join(lacking)}: {_EXPECTED}.")
    config: Mapping[str, Any] = inner.config  # type: ignore[attr-defined]
    rates = [config.get(name) for name in ("simulation_frequency", "policy_frequency")]
    if rates != [RATE_HZ, RATE_HZ]:
        raise UsageError(
            f"gymnasium:{identifier} runs at simulation_frequency {rates[0]} and policy_frequency {rates[1]}, expected "
            f"{RATE_HZ} and {RATE_HZ}: with another ratio time and motion disagree. It overrides the config it is given."
        )
    ranges = ("acceleration_range", "steering_range")
    space = getattr(inner, "action_space", None)
    if not all(hasattr(inner.action_type, name) for name in ranges) or np.shape(space.sample()) != (2,):  # type: ignore[attr-defined,union-attr]
        raise UsageError(
            f"gymnasium:{identifier} has the actions {space}, expected highway-env's ContinuousAction of two numbers, "
            "acceleration and steering."
        )


@functools.cache
def _driven(creator: type[AbstractEnv], mixin: type) -> type[AbstractEnv]:
    return type(f"{mixin.__name__}{creator.__name__}", (mixin, creator), {"__module__": __name__})
