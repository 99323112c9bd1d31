"""The numbers of each agent's controller, found with `benchmarks/controllers.py`: a perfect network drives by them.

Published gains belong to CARLA's car, which turns its wheels twice as far, and the published target rules let no agent
leave its lane: a target straight ahead always has the smaller angle. So the gains are larger, the target rules hold
near the target only, two pairs of waypoints tell the speed (more of them see a start before it is due), and a wish
below 0.8 m/s means to stop. The caps keep their order: TCP's throttle is cut above walking pace, UniAD's is shut off
at a speed, VAD's is the same at every speed.
"""

from __future__ import annotations

from dataclasses import replace

from drive_robust_agents._wrappers.pid import Gains, WaypointTuning

__all__ = ["PUBLISHED", "TCP", "UNIAD", "VAD"]

_SPEED = Gains(p=5.0, i=0.5, d=1.0, window=40)

PUBLISHED = WaypointTuning(
    turn=Gains(p=0.75, i=0.75, d=0.3, window=40),
    speed=_SPEED,
    speed_pairs=5,
    target_turn=0.3,
    target_within_m=10.0,
    brake_below_mps=0.4,
)
"""Bench2Drive's numbers, without caps: for comparison."""

_SHARED = WaypointTuning(
    turn=Gains(p=2.25, i=0.5, d=0.5, window=40),
    speed=_SPEED,
    speed_pairs=2,
    target_turn=0.6,
    target_within_m=8.0,
    calm_within_m=8.0,
    brake_below_mps=0.8,
)
TCP = replace(_SHARED, free_throttle=0.5, cruise_throttle=0.3, free_mps=1.5, free_turning_mps=1.0)
"""Published: 0.05 in place of 0.3."""
UNIAD = replace(_SHARED, coast_above_mps=5.0)
VAD = replace(_SHARED, most_throttle=0.3)
"""Published: 0.75, which is 3.75 m/s2 here and too much for a small network's foresight: the same weights drove 8 of 44
held-out routes with 0.75 and 15 with 0.3."""
