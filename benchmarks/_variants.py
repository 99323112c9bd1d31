"""Register learned agents with one change as agents: `variant:uniad/our-numbers`.

Each change is one factor of the wrapper between the network and the car. `our-numbers` changes all factors at once,
because agents ship with the published numbers; `ours-but-...` changes one factor of our numbers. `angle-wrapped` steers
left for a target behind on the left, where the published agents steer right (`pid.published_turn_of`).
`ours-but-target-rule`, `-steering` and `-pedals` use the published numbers, whose steering or pedals are given to the
car unchanged, while those of our numbers are converted from a plain car (`_vehicle/plain_car.py`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._wrappers import tuning
from drive_robust_agents._wrappers.learned_agent import LearnedAgent, NetworkRow
from drive_robust_agents._wrappers.memory import LAG_TICKS, Memory
from drive_robust_agents._wrappers.path_controller import PathController
from drive_robust_agents._wrappers.pid import Gains, Point, WaypointController
from drive_robust_agents.simlingo import SimLingo
from drive_robust_agents.tcp import TCP
from drive_robust_agents.uniad import UniAD
from drive_robust_agents.vad import VAD
from pytest_drive_robust import Control, GlobalPlan, Observation
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.cache_key.source_files import source_digest

__all__ = ["VARIANTS", "Change", "Variant", "pytest_drive_robust_register"]


@dataclass(frozen=True)
class Change:
    """One change: options of the agent, numbers of its controller, and controls that are not converted for the car.

    `moved_by_speed`: the movement since the memory is the measured speed times 0.5 s, not a difference of GPS.
    `behind_m`: GPS reads a place that far behind, along the compass. `to_target`: the plan is turned towards the target
    point by this share of the angle; 1 steers straight at the target. `forgets`: there is no memory in any tick, as in
    the first ones of an episode and in half of the training.
    """

    options: Mapping[str, Any] = field(default_factory=dict)
    numbers: Mapping[str, Any] = field(default_factory=dict)
    steers_as_it_is: bool = False
    pedals_as_they_are: bool = False
    moved_by_speed: bool = False
    behind_m: float = 0.0
    to_target: float = 0.0
    forgets: bool = False


_TARGET_RULE = Change(
    numbers={"target_turn": 0.3, "target_within_m": 10.0, "calm_within_m": float("inf"), "behind_is_right": True}
)
_WRAPPED = Change(numbers={"behind_is_right": False})
_STEERING = Change(numbers={"turn": tuning.PUBLISHED.turn}, steers_as_it_is=True)
_NO_CAP = Change(numbers={"coast_above_mps": float("inf")})
_SPEEDOMETER = Change(moved_by_speed=True)
_FORGETS = Change(forgets=True)
_BEHIND = Change(behind_m=20.0)
_HALFWAY, _STRAIGHT = Change(to_target=0.5), Change(to_target=1.0)
_NOTHING = Change()


def _pedals(**caps: Any) -> Change:
    rule = {"speed_pairs": 5, "brake_below_mps": 0.4, **caps}
    return Change(numbers=rule, pedals_as_they_are=True)


def _ours(**changes: Change) -> dict[str, Change]:
    """Return our numbers, as `our-numbers`, and the changes to them, as `ours-but-...`."""
    named = {f"ours-but-{name.replace('_', '-')}": change for name, change in changes.items()}
    return {
        name: replace(change, options={"tuning": "ours"}) for name, change in {"our-numbers": _NOTHING, **named}.items()
    }


def _halved(gains: Gains) -> Gains:
    return Gains(gains.p / 2.0, gains.i / 2.0, gains.d / 2.0, gains.window)


VARIANTS: Mapping[str, tuple[type[LearnedAgent], Mapping[str, Change]]] = {
    "tcp": (
        TCP,
        {
            "as-shipped": _NOTHING,
            "angle-wrapped": _WRAPPED,
            "place-20-m-behind": _BEHIND,
            "half-to-the-target": _HALFWAY,
            "straight-to-the-target": _STRAIGHT,
            **_ours(
                target_rule=_TARGET_RULE,
                steering=_STEERING,
                pedals=_pedals(cruise_throttle=tuning.TCP_PUBLISHED.cruise_throttle, full_brake=True),
            ),
        },
    ),
    "uniad": (
        UniAD,
        {
            "as-shipped": _NOTHING,
            "angle-wrapped": _WRAPPED,
            "no-cap-of-5-mps": _NO_CAP,
            "memory-by-speedometer": _SPEEDOMETER,
            "no-memory": _FORGETS,
            **_ours(
                target_rule=_TARGET_RULE,
                steering=_STEERING,
                pedals=_pedals(),
                no_cap_of_5_mps=_NO_CAP,
                memory_by_speedometer=_SPEEDOMETER,
            ),
        },
    ),
    "vad": (
        VAD,
        {
            "as-shipped": _NOTHING,
            "angle-wrapped": _WRAPPED,
            "memory-by-speedometer": _SPEEDOMETER,
            "no-memory": _FORGETS,
            **_ours(
                target_rule=_TARGET_RULE,
                steering=_STEERING,
                pedals=_pedals(most_throttle=tuning.VAD_PUBLISHED.most_throttle),
                memory_by_speedometer=_SPEEDOMETER,
            ),
        },
    ),
    "simlingo": (
        SimLingo,
        {
            "as-shipped": _NOTHING,
            "filter-that-knows-the-time": Change(options={"position_filter": "elapsed"}),
            "raw-gps": Change(options={"position_filter": "none"}),
            "half-the-gain": Change(numbers={"turn": _halved(tuning.SIMLINGO_PUBLISHED.turn)}),
            "place-20-m-behind": _BEHIND,
            "half-to-the-target": _HALFWAY,
            "straight-to-the-target": _STRAIGHT,
            "commentary": Change(options={"commentary": True}),
            **_ours(),
        },
    ),
}
"""The class of each learned agent, and its changes by name. `as-shipped` changes nothing."""


_PLANS = {"path", "waypoints"}
"""The outputs of a network that are plans: (N, 2) metres, forward and right of the ego."""


def _turned(plan: NDArray[Any], target: Point, share: float) -> NDArray[Any]:
    """Return the plan turned about the ego by a share of the angle from the plan's last point to the target."""
    (ahead, right), (target_ahead, target_right) = plan[-1].tolist(), target
    angle = share * math.remainder(math.atan2(target_right, target_ahead) - math.atan2(right, ahead), math.tau)
    c, s = math.cos(angle), math.sin(angle)
    return plan @ np.array([[c, s], [-s, c]], dtype=plan.dtype)


class _Changed(LearnedAgent):
    """A mix-in for an agent's class that applies a `Change`."""

    change: ClassVar[Change]
    remembers: ClassVar[Mapping[str, tuple[int, ...]]]
    _controller: WaypointController | PathController

    def reset(self, route: GlobalPlan, seed: int) -> None:
        super().reset(route, seed)
        if self.change.numbers:
            kind: Any = type(self._controller)
            self._controller = kind(replace(self._controller.tuning, **self.change.numbers))

    def _prepare(self, observation: Observation) -> NetworkRow:
        if self.change.behind_m:
            gps, yaw = observation.gps, observation.compass.yaw_rad
            x_m, y_m = gps.x_m - self.change.behind_m * math.cos(yaw), gps.y_m - self.change.behind_m * math.sin(yaw)
            observation = replace(observation, gps=replace(gps, x_m=x_m, y_m=y_m))
        if self.change.forgets:
            self._memory = Memory(self.remembers)
        row = super()._prepare(observation)
        if self.change.moved_by_speed and row.inputs["known"]:
            moved = (observation.speed.mps * 0.05 * LAG_TICKS, 0.0)
            row.inputs["motion"][:2] = row.inputs["can_bus"][4:] = moved
        return row

    def _control(
        self, observation: Observation, targets: tuple[Point, ...], outputs: Mapping[str, NDArray[Any]]
    ) -> Control:
        if self.change.to_target:
            turned = {name: _turned(outputs[name], targets[0], self.change.to_target) for name in _PLANS & set(outputs)}
            outputs = {**outputs, **turned}
        return super()._control(observation, targets, outputs)

    def _for_driven_car(self, control: Control, speed_mps: float) -> Control:
        converted = super()._for_driven_car(control, speed_mps)
        pedals = control if self.change.pedals_as_they_are else converted
        steer = (control if self.change.steers_as_it_is else converted).steer
        return Control(pedals.throttle, steer, pedals.brake)


class Variant:
    """A factory of one agent with one change. Its code and this one, its weights and the change key its episodes."""

    def __init__(self, agent: str, name: str) -> None:
        cls, changes = VARIANTS[agent]
        self._change = changes[name]
        self._made: Any = type(f"Changed{cls.__name__}", (_Changed, cls), {"change": self._change})
        self.__wrapped__ = cls
        self.__module__, self.__qualname__ = cls.__module__, cls.__qualname__
        self.weights, self.computed_by = cls.weights, cls.computed_by
        self.configuration = {"change": repr(self._change), "changed by": source_digest(_Changed)}

    def __call__(self) -> LearnedAgent:
        """Return a new agent, changed."""
        agent: LearnedAgent = self._made(**self._change.options)
        return agent


def _variant(argument: str) -> Variant:
    """Return the factory of `AGENT/CHANGE`. Raises `UnknownNameError`."""
    agent, _, name = argument.partition("/")
    if agent not in VARIANTS:
        raise UnknownNameError.of("learned agent", agent, VARIANTS)
    if name not in VARIANTS[agent][1]:
        raise UnknownNameError.of(f"change of {agent}", name, VARIANTS[agent][1])
    return Variant(agent, name)


def pytest_drive_robust_register(registry: Registry) -> None:
    """Make `variant:AGENT/CHANGE` an agent."""
    registry.register_agent("variant", _variant, argument="AGENT/CHANGE")
