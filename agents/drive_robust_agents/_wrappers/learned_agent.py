"""The base of the learned agents: each looks, one network answers for all of them at once, each follows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.inference import ENGINES, LoadedNetwork, Network
from drive_robust_agents._nets.weights import locate
from drive_robust_agents._vehicle.mkz import Pedals
from drive_robust_agents._vehicle.plain_car import pedals_from_plain, steer_from_plain
from drive_robust_agents._wrappers.pid import Point
from drive_robust_agents._wrappers.route_planner import MIN_M, RoutePlanner, Target
from drive_robust_agents._wrappers.tuning import Tuning, tuning_called
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath
from pytest_drive_robust.errors import UsageError

__all__ = ["LearnedAgent", "NetworkRow"]


class NetworkRow(NamedTuple):
    """One row of the network's inputs, and the target points behind it: (forward, right) metres of the vehicle."""

    inputs: Mapping[str, NDArray[Any]]
    targets: tuple[Point, ...]


class LearnedAgent(ABC):
    """A network that drives, with all that an episode remembers.

    A subclass names itself as the manifest of weights does and says which class its network is (`"tcp:TcpNet"`: the
    module in `_nets` and the class in it), which files ship with it, what the specification of a network for its rig
    says of the pictures (`pictures`: weights of another rig are refused), and within how many metres it drops a point
    of the plan. Constructors repeat the keywords below, so that a reader of one agent sees all that it takes.

    `tuning` says whose numbers turn the plan into controls. `"published"` are those of the released agent, made for
    CARLA's car, and what they give is what it gives. `"ours"` are found for a plain car: it gives the controls with
    which the car that is driven moves alike (`plain_car`). Raises `UnknownNameError` for others.
    """

    consumes: ClassVar[frozenset[str]]
    name: ClassVar[str]
    architecture: ClassVar[str]
    weights: ClassVar[tuple[Path, ...]]
    pictures: ClassVar[Mapping[str, Any]]
    drops_within_m: ClassVar[float] = MIN_M
    computed_by: tuple[str, ...] = ENGINES["onnx"]

    _method = "forward"
    """Which method of the network is asked."""

    def __init__(
        self,
        *,
        tuning: Tuning = "published",
        engine: str = "onnx",
        device: str = "cpu",
        dtype: str = "float32",
        threads: int = 1,
        weights: str | Path | None = None,
        network: Network | None = None,
    ) -> None:
        """Take `network` or, without one, make it from `engine` to `weights` with `LoadedNetwork.of`."""
        self.tuning: Tuning = tuning_called(tuning, agent=self.name)
        self._network = network or LoadedNetwork.of(
            self.name,
            self.architecture,
            engine=engine,
            device=device,
            dtype=dtype,
            threads=threads,
            weights=weights,
        )
        if network is None:
            self._require_rig(weights)
        self.computed_by = ENGINES[engine]
        self.reset(GlobalPlan(()), 0)

    @classmethod
    def check(cls, **options: Any) -> None:
        """Raise `UsageError` for options that it would not take, and for weights that are not what their manifest says.

        `options` are those in its name. A device is looked for where the agent is made.
        """
        tuning_called(options.get("tuning", "published"), agent=cls.name)
        if isinstance(options.get("network"), str):
            raise UsageError(
                f"the network of {cls.name!r} is an object that only its constructor can be given. Name a file of "
                f"weights instead, as in '{cls.name}:weights=FILE'."
            )
        computed = {name: options[name] for name in ("engine", "dtype", "threads", "weights") if name in options}
        LoadedNetwork.check(cls.name, cls.architecture, **computed)
        cls._require_rig(options.get("weights"))

    @classmethod
    def _require_rig(cls, weights: str | Path | None) -> None:
        _, entry = locate(cls.name, weights)
        other = "; ".join(_differences(cls.pictures, entry.spec))
        if other:
            raise UsageError(
                f"the weights {entry.label} are for another rig than that of {cls.name!r}: {other}. Train new ones on "
                "frames of this rig, or install the drive-robust-agents that they were made with."
            )

    @abstractmethod
    def sensors(self) -> Sequence[CameraSpec]:
        """Return the cameras of the rig."""

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode. The seed is not used: nothing is drawn."""
        self._planner = RoutePlanner(route, min_m=self.drops_within_m) if route.points else None
        self._planned = PlannedPath()

    def act(self, observation: Observation) -> Control:
        """Look, plan, steer. Raises `ValueError` before a `reset` with a plan."""
        return self.act_batch((self,), (observation,))[0]

    @classmethod
    def act_batch(cls, agents: Sequence[LearnedAgent], observations: Sequence[Observation]) -> Sequence[Control]:
        """Act for agents that share a network and are made alike, in one run of it."""
        seen = [agent._look(observation) for agent, observation in zip(agents, observations, strict=True)]
        inputs = {name: np.stack([one.inputs[name] for one in seen]) for name in seen[0].inputs}
        outputs = agents[0]._network.run(agents[0]._method, **inputs)
        return [
            agent._follow(observation, one.targets, {name: values[row] for name, values in outputs.items()})
            for row, (agent, observation, one) in enumerate(zip(agents, observations, seen, strict=True))
        ]

    def plan(self) -> PlannedPath:
        """Return path, target points and waypoints behind the last control."""
        return self._planned

    @abstractmethod
    def _look(self, observation: Observation) -> NetworkRow:
        """Return what the network is asked in this tick."""

    @abstractmethod
    def _follow(
        self, observation: Observation, targets: tuple[Point, ...], outputs: Mapping[str, NDArray[Any]]
    ) -> Control:
        """Turn the outputs for this row into a control, and set what `plan` shows."""

    def _given(self, control: Control, speed_mps: float) -> Control:
        """Return what the car is given for a control of the agent's controller, at the measured speed."""
        if self.tuning == "published":
            return control
        throttle, brake = pedals_from_plain(speed_mps, Pedals(control.throttle, control.brake))
        return Control(throttle, steer_from_plain(control.steer), brake)

    def _target(self, x_m: float, y_m: float) -> Target:
        """Return where the route goes on from a position in its frame. Once a tick: it drops what has been reached."""
        if self._planner is None:
            raise ValueError("the agent has no route, expected reset(route, seed) with a plan before the first act")
        return self._planner.step(x_m, y_m)


def _differences(taken: Mapping[str, Any], spec: Mapping[str, Any], within: str = "") -> Iterator[str]:
    """Return what a network's specification says of pictures that the cameras do not take."""
    for name, value in taken.items():
        given = spec.get(name, value)
        if isinstance(value, Mapping) and isinstance(given, Mapping):
            yield from _differences(value, given, f"{within}{name}.")
        elif given != value:
            yield f"{within}{name} is {given!r}, the cameras of the agent give {value!r}"
