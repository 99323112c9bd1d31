"""`vad`: a compact re-implementation of VAD, "Vectorized Scene Representation" (Jiang et al., ICCV 2023).

Never the original: 0.88 M parameters in place of about 58 M (cameras, bird's-eye map and memory 0.40 M, agent queries
0.11 M, map vectors 0.12 M, lane net 0.01 M, motion 0.10 M, planner 0.14 M), six pictures of 160 x 96 in place of
1600 x 900, trained in the embedded world.

Kept: a bird's-eye map of features queried from six cameras under a can bus, with the map of the last frame shifted by
the *sensed* motion (`_nets.bev` tells what of BEVFormer is not kept); agent queries with boxes and several futures;
map vectors whose queries are the sum of an instance and a point embedding, summarised by a lane net with a maximum over
points; futures that look at one another and at lanes; an ego query that looks at agents, then at lanes; one plan for
each of the six commands, of which the command picks one; no speed and no ego state in the plan head; the losses (focal
and L1 after matching, winner takes all, points in either order) and the three constraints on the plan; GridMask.

Not kept: 24 agents, 12 vectors of 6 points and 3 futures in place of 300, 100 of 20 and 6, two decoder layers in place
of six; plain attention in place of deformable; queries begin at anchors that move from layer to layer; the constraints
are measured against labels in place of own predictions; the ego query also looks at the bird's-eye map before it looks
at agents; the cells of that map are labelled in training and the ego query is asked about the light and what is near
ahead (auxiliaries that the published model does not have); the memory is 0.5 s old at run time too, and one step deep.

The wrapper is that of Bench2DriveZoo's `vad_b2d_agent.py`: raw GPS, a route planner that drops points by it, the can
bus from GPS, compass, speedometer and IMU, a PID on waypoints that falls back to the target point, a throttle
that no speed cuts, the brake dropped where the throttle is larger. Gains and target rules are the published ones; those
of `tuning="ours"` were found for a plain car (`_wrappers.tuning`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from drive_robust_agents._nets.weights import SHIPPED
from drive_robust_agents._wrappers import tuning as numbers
from drive_robust_agents._wrappers.bev_agent import BevAgent
from drive_robust_agents._wrappers.pid import WaypointTuning
from drive_robust_agents._wrappers.tuning import Tuning

__all__ = ["VAD"]


class VAD(BevAgent):
    """Six cameras, GPS, compass, IMU and speed in; six waypoints for the command, a control out.

    The options are those of `LearnedAgent`.
    """

    name = "vad"
    network_class = "vad:VadNet"
    weights = (SHIPPED / "vad.safetensors", SHIPPED / "vad.onnx")
    tunings: ClassVar[Mapping[Tuning, WaypointTuning]] = {"ours": numbers.VAD, "published": numbers.VAD_PUBLISHED}
    remembers: ClassVar[Mapping[str, tuple[int, ...]]] = {"bev": (64, 40, 16)}
