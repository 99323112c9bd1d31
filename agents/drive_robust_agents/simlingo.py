"""`simlingo`: a compact re-implementation of SimLingo, vision-only driving with language (Renz et al., CVPR 2025).

Never the original: 1.35 M parameters in place of about 900 M, trained in the embedded world from nothing. It has no
knowledge of language: 95 words, a grammar of prompts and instructions, and anything else is refused.

Kept: one causal transformer that reads the image, then a prompt (the speed as a token and as text, two target points
in place of placeholders), then its own answer word by word, then learned queries whose last hidden states are the plan:
20 path points one metre apart, which steer, and 10 waypoints 0.25 s apart, which drive. Commentary before acting;
instructions learnt from dreams, obeyed after `<follow>`, weighed after `<safety>`. The wrapper: a Kalman filter on GPS
(noise averages out), a route planner with 7.5 m, the raw speedometer, creeping after 40 s of standing, a brake in the
first tick. Its augmentation without missing blocks.

Not kept: InternVL2-1B and its pretraining (a residual net of 0.38 M and four layers of width 128 stand in its place),
tiles, LoRA, sampling up to 100 new tokens (at most 16, the likeliest), the unscented form of the filter. Unlike the
published agent it keeps keys and values; commentary costs time that depends on its length all the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.inference import Policy
from drive_robust_agents._nets.prompts import by_targets, comment, driving, instructed, parse_instruction, prompt_row
from drive_robust_agents._nets.simlingo import SimLingoNet
from drive_robust_agents._nets.words import CLOSING, decode
from drive_robust_agents._wrappers.kalman import PositionFilter
from drive_robust_agents._wrappers.path_controller import Creep, PathController
from drive_robust_agents._wrappers.pid import Point
from drive_robust_agents._wrappers.route_planner import MIN_SIMLINGO_M, RoutePlanner
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.rigs import rig

__all__ = ["CAMERAS", "Network", "SimLingo"]

CAMERAS = rig("simlingo", width_px=256, height_px=128)
"""One wide camera above and behind the driver, at a quarter of the published resolution."""

_FULL_BRAKE = Control(brake=1.0)


class Network(Protocol):
    """What the agent needs of `_nets.inference.Policy`."""

    def run(self, method: str = "forward", /, **inputs: NDArray[Any]) -> Mapping[str, NDArray[Any]]:
        """All rows at once: arrays with the batch axis first."""
        ...


class Seen(NamedTuple):
    """One row of the network's inputs."""

    image: NDArray[np.uint8]
    speed: float
    target: tuple[Point, Point]
    prompt: tuple[int, ...]


class SimLingo:
    """One front camera, filtered position and raw speed in; a path, waypoints, maybe a sentence, and a control out.

    `commentary` lets it say what it does, and why, before it plans (`said`). `instruction` is a sentence that it keeps
    to for whole episodes: `"drive at 8 m/s"`, `"change lane to the left"` (`_nets.prompts.PHRASES` has them all); with
    `safety` it may refuse it. `weights` is a file with its `manifest.json` beside it; those that ship by default.
    `engine` is `"torch"` or, without commentary, `"onnx"`; `device`, `dtype` and `threads` are those of
    `_nets.inference`. `network` replaces the network, for tests. Raises `UsageError` for sentences that it does not
    know, and for weights that are missing or not what their manifest says.
    """

    consumes: frozenset[str] = frozenset({"cameras", "gps", "compass", "speed"})
    weights: ClassVar[tuple[Path, ...]] = (Path(__file__).parent / "weights" / "simlingo.safetensors",)
    configuration: ClassVar[Mapping[str, str]] = {"commentary": "no", "engine": "torch", "dtype": "float32"}

    def __init__(
        self,
        commentary: bool = False,
        instruction: str | None = None,
        *,
        safety: bool = False,
        engine: str = "torch",
        device: str = "cpu",
        dtype: str = "float32",
        threads: int = 1,
        weights: str | Path | None = None,
        network: Network | None = None,
    ) -> None:
        if commentary and engine == "onnx":
            raise UsageError("simlingo says nothing with engine='onnx': give engine='torch' or commentary=False.")
        self.commentary, self.safety = commentary, safety
        self.instruction = None if instruction is None else parse_instruction(instruction)
        self._network: Network = network or Policy.of(
            "simlingo",
            SimLingoNet.build,
            engine=engine,
            device=device,
            dtype=dtype,
            threads=threads,
            weights=weights,
        )
        self.reset(GlobalPlan(()), 0)

    def sensors(self) -> Sequence[CameraSpec]:
        """One wide camera above and behind the driver."""
        return CAMERAS

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode. The seed is not used: nothing is drawn."""
        self._planner = RoutePlanner(route, min_m=MIN_SIMLINGO_M) if route.points else None
        self._filter, self._controller, self._creep = PositionFilter(), PathController(), Creep()
        self._last: Control | None = None
        self._planned = PlannedPath()
        self.said = ""
        """The last sentence: what it does and why; empty without commentary."""

    def act(self, observation: Observation) -> Control:
        """Look, maybe speak, plan, steer. Raises `ValueError` before a `reset` with a plan."""
        return self.act_batch((self,), (observation,))[0]

    @classmethod
    def act_batch(cls, agents: Sequence[SimLingo], observations: Sequence[Observation]) -> Sequence[Control]:
        """`act` for agents that share a network, in one run of it. All of them comment, or none."""
        seen = [agent._look(observation) for agent, observation in zip(agents, observations, strict=True)]
        outputs = agents[0]._network.run(
            "generate" if agents[0].commentary else "forward",
            image=np.stack([row.image for row in seen]),
            speed=np.array([row.speed for row in seen], dtype=np.float32),
            target=np.array([row.target for row in seen], dtype=np.float32),
            prompt=np.array([row.prompt for row in seen], dtype=np.int64),
        )
        rows = [{name: values[k] for name, values in outputs.items()} for k in range(len(seen))]
        return [agent._follow(row, output) for agent, row, output in zip(agents, seen, rows, strict=True)]

    def plan(self) -> PlannedPath:
        """Path, target points and waypoints behind the last control."""
        return self._planned

    def _look(self, observation: Observation) -> Seen:
        if self._planner is None:
            raise ValueError("the agent has no route, expected reset(route, seed) with a plan before the first act")
        gps, speed = observation.gps, observation.speed.mps
        here = self._filter.step(gps.x_m, gps.y_m, observation.compass.yaw_rad, speed, self._last or _FULL_BRAKE)
        target = self._planner.step(here.x_m, here.y_m).seen_from(here.x_m, here.y_m, here.yaw_rad)
        pixels = observation.cameras[CAMERAS[0].name].pixels
        return Seen(pixels, speed, target, prompt_row(self._prompt(speed)))

    def _prompt(self, speed_mps: float) -> str:
        way = by_targets(speed_mps)
        if self.instruction is not None:
            return instructed(way, self.instruction, safety=self.safety)
        return comment(way) if self.commentary else driving(way)

    def _follow(self, seen: Seen, output: Mapping[str, NDArray[Any]]) -> Control:
        """The control of one row; the first tick of an episode brakes."""
        path, waypoints = (tuple((x, y) for x, y in output[name].tolist()) for name in ("path", "waypoints"))
        self._planned = PlannedPath(path, seen.target, waypoints)
        if "answer" in output:
            self.said = decode(number for number in output["answer"].tolist() if number != CLOSING)
        pedals = self._controller.step(path, waypoints, seen.speed)
        control = Control(pedals.throttle, pedals.steer, pedals.brake)
        if self._creep.step(seen.speed):
            control = Control(Creep.THROTTLE, pedals.steer)
        self._last = _FULL_BRAKE if self._last is None else control
        return self._last
