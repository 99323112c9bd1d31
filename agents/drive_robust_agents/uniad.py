"""`uniad`: a compact re-implementation of UniAD, "Planning-oriented Autonomous Driving" (Hu et al., CVPR 2023).

Never the original: 0.96 M parameters in place of well over 100 M (cameras, bird's-eye map and memory 0.40 M, overview
0.04 M, tracks 0.20 M, lanes 0.07 M, motion 0.11 M, occupancy 0.05 M, planner 0.08 M), six pictures of 160 x 96 in
place of 1600 x 900, trained in the embedded world.

Kept: a bird's-eye map of features queried from six cameras under a can bus, with the map of the last frame moved by
the *sensed* motion (`_nets.bev` tells what of BEVFormer is not kept); track queries with an ego query among them, the
old ones propagated by a query interaction layer; lane queries with masks; motion modes of every agent and the ego that
look at agents, lanes and the map, each a normal distribution a step; occupancy carried from step to step, an agent's by
the product of its query with the cells; a planner that reads the ego's motion modes, its track query without gradient
and an embedding of the command, takes the largest of the modes, looks at the map and sums up offsets; the plan moved
off occupied cells when driving, with the published cost; the published losses (Hungarian matching, focal and L1, dice,
winner takes all, three collision losses), both stages of training, and GridMask.

Not kept: 24 agents, 12 lanes and 3 modes in place of 900, 300 and 6, two decoder layers for tracks and one for motion
in place of six and three; plain attention to a map of 20 x 8 tokens in place of deformable attention to 200 x 200;
track queries begin at the peaks of a heat map of centres; old queries are looked at, not kept alive, so tracks have no
identity beyond one step; occupancy on 80 x 32 cells; 6 steps of motion in place of 12; the optimisation of the plan by
damped Newton steps in place of IPOPT; the ego query looks at the front camera's tokens and is told in training about
the light and what is near ahead, and the cells of the map are labelled (auxiliaries that the published model does not
have); the memory is 0.5 s old at run time too.

The wrapper is that of Bench2DriveZoo's `uniad_b2d_agent.py`: raw GPS, a route planner that drops points by it, the can
bus from GPS, compass, speedometer and IMU, a PID on waypoints that falls back to the target point, no throttle above a
speed (5 m/s), the brake dropped where the throttle is larger. Gains and target rules are the published ones; those of
`tuning="ours"` were found for a plain car (`_wrappers.tuning`). By the published it passes 9 of the 44 routes of
`one-per-scenario`; perfect waypoints pass 16 by them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.bev_grid import BevSpec
from drive_robust_agents._nets.inference import Network
from drive_robust_agents._nets.weights import SHIPPED
from drive_robust_agents._wrappers import tuning as numbers
from drive_robust_agents._wrappers.bev_agent import BevAgent
from drive_robust_agents._wrappers.collision import clear_of
from drive_robust_agents._wrappers.pid import WaypointTuning
from drive_robust_agents._wrappers.tuning import Tuning

__all__ = ["OCCUPIED_FROM", "UniAD"]

OCCUPIED_FROM = 0.5
"""Least probability of occupancy of cells that the plan keeps clear of."""

_CENTRES = BevSpec().centres(finer=2)


class UniAD(BevAgent):
    """Six cameras, GPS, compass, IMU and speed in; six waypoints clear of what will be occupied, a control out.

    `optimise=False` leaves the plan as the network gives it. The other options are those of `LearnedAgent`.
    """

    name = "uniad"
    network_class = "uniad:UniadNet"
    weights = (SHIPPED / "uniad.safetensors", SHIPPED / "uniad.onnx")
    tunings: ClassVar[Mapping[Tuning, WaypointTuning]] = {"ours": numbers.UNIAD, "published": numbers.UNIAD_PUBLISHED}
    remembers: ClassVar[Mapping[str, tuple[int, ...]]] = {"bev": (64, 40, 16), "queries": (24, 64), "spots": (24, 2)}

    def __init__(
        self,
        *,
        optimise: bool = True,
        tuning: Tuning = "published",
        engine: str = "onnx",
        device: str = "cpu",
        dtype: str = "float32",
        threads: int = 1,
        weights: str | Path | None = None,
        network: Network | None = None,
    ) -> None:
        super().__init__(
            tuning=tuning, engine=engine, device=device, dtype=dtype, threads=threads,
            weights=weights, network=network,
        )  # fmt: skip
        self._optimise = optimise

    def _waypoints(self, outputs: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
        """Return the network's plan, moved off the cells that will be occupied."""
        plan = outputs["waypoints"]
        if not self._optimise or not np.isfinite(plan).all():
            return plan
        return clear_of(plan, outputs["occupancy"], _CENTRES, from_share=OCCUPIED_FROM)
