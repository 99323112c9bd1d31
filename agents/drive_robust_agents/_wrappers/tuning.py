"""The numbers of each agent's controller, tuned with `benchmarks/controllers.py`, where a perfect network drives.

Our numbers are tuned for a plain car and converted for the driven car (`plain_car`). The published gains belong to
CARLA's car, which turns 1.3 times as much, and the published target rules let no agent leave its lane, because a target
straight ahead always has the smaller angle. Our gains are therefore larger, the target rules hold only near the target,
two pairs of waypoints give the speed (more pairs see a start before it is due), and a wanted speed below 0.8 m/s means
to stop. The throttle limits keep their order: TCP's throttle is cut above walking pace, UniAD's is shut off at a speed,
VAD's is equal at every speed.

`"published"` numbers are those of the released agents, unchanged, for CARLA's car: TCP's from Bench2DriveZoo
`TCP/config.py`, `TCP/model.py` and `team_code/tcp_b2d_agent.py`, UniAD's and VAD's from `team_code/pid_controller.py`
and `team_code/{uniad,vad}_b2d_agent.py` of the same repository, SimLingo's from `team_code/nav_planner.py`,
`config_simlingo.py` and `agent_simlingo.py`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, get_args

from drive_robust_agents._wrappers.path_controller import PathTuning
from drive_robust_agents._wrappers.pid import Gains, WaypointTuning
from pytest_drive_robust.errors import UnknownNameError

__all__ = [
    "PUBLISHED", "SIMLINGO", "SIMLINGO_PUBLISHED", "TCP", "TCP_PUBLISHED", "UNIAD", "UNIAD_PUBLISHED", "VAD",
    "VAD_PUBLISHED", "Tuning", "require_tuning",
]  # fmt: skip

Tuning = Literal["ours", "published"]
"""The origin of a controller's numbers. Ours are tuned for a plain car, and their controls converted (`plain_car`)."""

PUBLISHED = WaypointTuning(
    turn=Gains(p=0.75, i=0.75, d=0.3, window=40),
    speed=Gains(p=5.0, i=0.5, d=1.0, window=40),
    aim_m=4.0,
    speed_pairs=5,
    target_turn=0.3,
    target_within_m=10.0,
    calm_within_m=math.inf,
    behind_is_right=True,
    brake_below_mps=0.4,
    brake_ratio=1.1,
    most_missing_mps=0.25,
    most_throttle=0.75,
)
"""Bench2Drive's numbers, equal in TCP's `config.py` and the `pid_controller.py` of UniAD and VAD; without caps."""
TCP_PUBLISHED = replace(
    PUBLISHED,
    free_throttle=0.5,
    cruise_throttle=0.05,
    free_mps=1.5,
    free_turning_mps=1.0,
    turning=0.07,
    full_brake=True,
)
"""The caps of `tcp_b2d_agent.py`: 0.05 above 1.5 m/s (1.0 m/s beyond a steering of 0.07), 0.5 below; full brakes."""
UNIAD_PUBLISHED = replace(PUBLISHED, coast_above_mps=5.0)
"""`uniad_b2d_agent.py`: no throttle above 5 m/s."""
VAD_PUBLISHED = PUBLISHED
"""`vad_b2d_agent.py` has no cap but that of the controller, 0.75."""

_SHARED = replace(
    PUBLISHED,
    turn=Gains(p=2.25, i=0.5, d=0.5, window=40),
    speed_pairs=2,
    target_turn=0.6,
    target_within_m=8.0,
    calm_within_m=8.0,
    behind_is_right=False,
    brake_below_mps=0.8,
)
TCP = replace(_SHARED, free_throttle=0.5, cruise_throttle=0.3, free_mps=1.5, free_turning_mps=1.0, turning=0.07)
"""Published: 0.05 in place of 0.3."""
UNIAD = replace(_SHARED, coast_above_mps=5.0)
VAD = replace(_SHARED, most_throttle=0.3)
"""Published: 0.75, which is 3.75 m/s2 of a plain car and too much for a small network's foresight: the same weights
drove 8 of 44 held-out routes with 0.75 and 15 with 0.3."""

SIMLINGO_PUBLISHED = PathTuning(
    turn=Gains(p=3.118357247806046, i=0.6406067986034124, d=1.3782508892109167, window=6),
    speed=Gains(p=1.75, i=1.0, d=2.0, window=20),
    look_s=0.36 * 0.9755321901954155,
    look_m=0.1 * 1.9152884533402488,
    least_look_m=2.4,
    most_look_m=10.5,
    speed_from=0,
    speed_to=2,
    brake_below_mps=0.4,
    brake_ratio=1.1,
    most_missing_mps=1.0,
)
"""`LateralPIDController(inference_mode=False)` uses speed in km/h and path points 0.1 m apart, hence 0.36 and 0.1. It
takes the next whole point, we interpolate. The waypoints are those of 0.25 and 0.75 s."""
SIMLINGO = replace(
    SIMLINGO_PUBLISHED,
    turn=Gains(p=2.2, i=0.641, d=1.378, window=6),
    look_s=0.5,
    look_m=0.19,
    least_look_m=2.8,
    speed_from=2,
    speed_to=6,
    brake_below_mps=0.8,
)
"""By the published gain and look-ahead a plain car overshoots when it changes lanes. By the published waypoints a small
network, whose plans slow down too gently, begins to brake too late."""


def require_tuning(name: str, *, agent: str) -> None:
    """Raise `UnknownNameError` with a hint for `agent` when there is no tuning of this name."""
    if name not in get_args(Tuning):
        raise UnknownNameError.of("tuning", name, get_args(Tuning), hint=f"As in '{agent}:tuning=published'.")
