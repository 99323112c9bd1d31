"""The base of the learned agents: each agent prepares its inputs, one network computes all rows, each agent steers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.engine_options import ENGINES
from drive_robust_agents._nets.inference import LoadedNetwork, Network
from drive_robust_agents._nets.weights import locate
from drive_robust_agents._vehicle.mkz import Pedals
from drive_robust_agents._vehicle.plain_car import pedals_from_plain, steer_from_plain
from drive_robust_agents._wrappers.pid import Point
from drive_robust_agents._wrappers.route_planner import MIN_M, RoutePlanner, Target
from drive_robust_agents._wrappers.tuning import Tuning, require_tuning
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath
from pytest_drive_robust.errors import UsageError

__all__ = ["LearnedAgent", "NetworkRow"]


class NetworkRow(NamedTuple):
    """One row of the network's inputs, and its target points: (forward, right) metres in the vehicle's frame."""

    inputs: Mapping[str, NDArray[Any]]
    targets: tuple[Point, ...]


class LearnedAgent(ABC):
    """An agent that drives by a network, with the memory of an episode.

    In each tick `_prepare` makes the inputs of the network from the observation, and `_control` makes the control from
    the outputs; `_for_driven_car` converts a controller's control for the car.

    A subclass defines these two, `sensors`, and the class attributes below. Constructors repeat the keywords below, so
    that a reader of one agent sees all of its options.

    `tuning` chooses the numbers that turn the plan into controls. `"published"` are the numbers of the released agent,
    made for CARLA's car, whose controls are applied unchanged. `"ours"` are numbers for a plain car, whose controls are
    converted so that the driven car moves alike (`plain_car`).

    `weights` is a file with its `manifest.json` beside it; the shipped weights by default. `engine`, `device`, `dtype`
    and `threads` are those of `LoadedNetwork.of`. `network` replaces the network, for tests. Raises `UsageError` for
    another tuning, for an engine that this machine lacks, and for weights that are missing or differ from their
    manifest.
    """

    consumes: ClassVar[frozenset[str]]
    name: ClassVar[str]
    """The agent's name in the manifest of weights."""
    network_class: ClassVar[str]
    """The class of the network and its module in `_nets`: `"tcp:TcpNet"`."""
    weights: ClassVar[tuple[Path, ...]]
    """The files of weights and graphs that ship."""
    pictures: ClassVar[Mapping[str, Any]]
    """The sizes of pictures in a network's specification: weights of another rig are refused."""
    drops_within_m: ClassVar[float] = MIN_M
    """The distance within which a point of the plan is dropped."""
    computed_by: tuple[str, ...] = ENGINES["onnx"]

    _method = "forward"
    """The method of the network that is run."""

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
        require_tuning(tuning, agent=self.name)
        self.tuning: Tuning = tuning
        self._network = network or LoadedNetwork.of(
            self.name,
            self.network_class,
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
        """Raise `UsageError` for invalid options, and for weights that differ from their manifest.

        `options` are the options in the agent's name. The device is checked only when the agent is made.
        """
        require_tuning(options.get("tuning", "published"), agent=cls.name)
        if isinstance(options.get("network"), str):
            raise UsageError(
                f"the network of {cls.name!r} is an object that only its constructor can be given. Name a file of "
                f"weights instead, as in '{cls.name}:weights=FILE'."
            )
        computed = {name: options[name] for name in ("engine", "dtype", "threads", "weights") if name in options}
        LoadedNetwork.check(cls.name, cls.network_class, **computed)
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
        """Return the control for an observation. Raises `ValueError` before a `reset` with a plan."""
        return self.act_batch((self,), (observation,))[0]

    @classmethod
    def act_batch(cls, agents: Sequence[LearnedAgent], observations: Sequence[Observation]) -> Sequence[Control]:
        """Return the controls of agents with a shared network and equal options, in one run of the network."""
        seen = [agent._prepare(observation) for agent, observation in zip(agents, observations, strict=True)]
        inputs = {name: np.stack([one.inputs[name] for one in seen]) for name in seen[0].inputs}
        outputs = agents[0]._network.run(agents[0]._method, **inputs)
        return [
            agent._control(observation, one.targets, {name: values[row] for name, values in outputs.items()})
            for row, (agent, observation, one) in enumerate(zip(agents, observations, seen, strict=True))
        ]

    def plan(self) -> PlannedPath:
        """Return path, target points and waypoints behind the last control."""
        return self._planned

    @abstractmethod
    def _prepare(self, observation: Observation) -> NetworkRow:
        """Return the inputs of the network in this tick, and the target points for `_control`."""

    @abstractmethod
    def _control(
        self, observation: Observation, targets: tuple[Point, ...], outputs: Mapping[str, NDArray[Any]]
    ) -> Control:
        """Convert the outputs of this agent's row to a control, and set the path that `plan` returns."""

    def _for_driven_car(self, control: Control, speed_mps: float) -> Control:
        """Return the control for the car from the control of the agent's controller, at the measured speed."""
        if self.tuning == "published":
            return control
        throttle, brake = pedals_from_plain(speed_mps, Pedals(control.throttle, control.brake))
        return Control(throttle, steer_from_plain(control.steer), brake)

    def _target(self, x_m: float, y_m: float) -> Target:
        """Return the target for a position in the route's frame; call once a tick, as reached points are dropped."""
        if self._planner is None:
            raise ValueError("the agent has no route, expected reset(route, seed) with a plan before the first act")
        return self._planner.step(x_m, y_m)


def _differences(taken: Mapping[str, Any], spec: Mapping[str, Any], within: str = "") -> Iterator[str]:
    """Yield the differences between a network's specified pictures and the pictures of the cameras."""
    for name, value in taken.items():
        given = spec.get(name, value)
        if isinstance(value, Mapping) and isinstance(given, Mapping):
            yield from _differences(value, given, f"{within}{name}.")
        elif given != value:
            yield f"{within}{name} is {given!r}, the cameras of the agent give {value!r}"
