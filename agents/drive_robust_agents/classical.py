"""`classical`: a modular pipeline of the old school, with a channel for every perturbation to hurt.

Raw GPS and compass place the vehicle on a smooth path through the sparse plan; the camera corrects the path by the
lane's markings, finds what stands in the way, and sees lamps and stop signs (`_vision`: it knows the palette of its
world); two controllers turn that into steering and pedals. Nothing is filtered that a deployed agent of this kind
would not filter: a noisy GPS reaches the steering wheel, a wrong speed the pedals, a frozen image everything.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._corridor import Corridor
from drive_robust_agents._junction import FRONT_M, JunctionRules
from drive_robust_agents._lane import LaneTracker
from drive_robust_agents._route import Junction, PlanPath
from drive_robust_agents._vision import CAMERA, Ground
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath, RoadOption

__all__ = ["Classical"]

Floats = NDArray[np.float64]

_DT_S = 0.05
_WHEELBASE_M, _STEER_MAX_RAD = 2.85, 0.61
_CRUISE_MPS, _TURN_MPS, _CAREFUL_MPS = 10.5, 5.0, 7.0
_BRAKE_MPS2, _STANDOFF_M = 3.6, 3.5
_LANE_SHARE = 0.85
_OFF_LANE_M = 0.6
_AHEAD_POINTS = 44


class Classical:
    """Drives by GPS, compass, speed and one front camera; stops for what it sees, and steps aside a little."""

    consumes: frozenset[str] = frozenset({"cameras", "gps", "compass", "speed"})

    def __init__(self) -> None:
        self.reset(GlobalPlan(()), 0)

    def sensors(self) -> Sequence[CameraSpec]:
        """One camera at the front edge of the roof."""
        return (CAMERA,)

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode. The seed is not used: nothing is drawn."""
        self._plan = route
        self._path: PlanPath | None = None
        self._ground, self._lane, self._corridor = Ground(), LaneTracker(), Corridor()
        self._rules = JunctionRules()
        self._yaw_rad = 0.0
        self._on_road = False
        self._integral = 0.0
        self._way: Floats = np.zeros((1, 2))

    def plan(self) -> PlannedPath:
        """The path that the last control followed."""
        return PlannedPath(path=tuple((float(x), float(y)) for x, y in self._way[1:31]))

    def act(self, observation: Observation) -> Control:
        """Perceive, choose a speed, steer."""
        yaw, speed = observation.compass.yaw_rad, observation.speed.mps
        if self._path is None:
            self._path, self._yaw_rad = PlanPath(self._plan, yaw), yaw
        pixels = observation.cameras[CAMERA.name].pixels
        travelled, turned = speed * _DT_S, math.remainder(yaw - self._yaw_rad, math.tau)
        self._yaw_rad = yaw
        at = self._path.locate(observation.gps.x_m, observation.gps.y_m)
        junction = self._path.next_junction(at)
        course = self._path.ahead(observation.gps.x_m, observation.gps.y_m, yaw, _AHEAD_POINTS)
        self._way = self._correct(course, pixels, self._path.to_lane_end(at), travelled, turned)
        inside = junction is not None and at > junction.entry_m - 3.0
        bases = self._ground.bases(pixels)
        self._corridor.update(bases, self._way, travelled, may_dodge=not inside)
        rules = self._rules.speed(pixels, bases, junction, at, speed)
        target = min(self._road_speed(at, junction), self._obstacle_speed(), rules)
        return self._control(target, speed)

    def _correct(
        self, course: Floats, pixels: NDArray[np.uint8], to_lane_end: float, travelled: float, turned: float
    ) -> Floats:
        """The plan's course moved towards the middle of the lane that the camera sees, as far as the path keeps it."""
        on_road = to_lane_end > -1.0
        if on_road and not self._on_road:
            self._lane.forget(*_line(course))
        self._on_road = on_road
        way: Floats = course.copy()
        if on_road:
            self._lane.move(travelled, turned)
            self._lane.see(pixels, self._ground.level)
            share = _LANE_SHARE * min(self._lane.quality / 0.3, 1.0)
            shift = share * (self._lane.middle(course[:, 0]) - course[:, 1])
            beyond = np.maximum(np.arange(len(course)) - to_lane_end, 0.0)
            way[:, 1] += np.clip(shift, -4.0, 4.0) * np.maximum(0.0, 1.0 - beyond / 8.0)
        return way

    # --- speed ---

    def _road_speed(self, at: float, junction: Junction | None) -> float:
        """Cruising speed, lower for a turn ahead and beside things at the edge."""
        target = _CAREFUL_MPS if self._corridor.tight or self._corridor.aside_m < -0.2 else _CRUISE_MPS
        if junction is not None:
            turn = _TURN_MPS if junction.command is not RoadOption.STRAIGHT else _CAREFUL_MPS
            target = min(target, math.sqrt(turn**2 + 2.0 * 1.8 * max(junction.entry_m - at, 0.0)))
        return target

    def _obstacle_speed(self) -> float:
        gap = self._corridor.free_m - FRONT_M - _STANDOFF_M
        return math.sqrt(2.0 * _BRAKE_MPS2 * gap) if gap > 0.0 else 0.0

    # --- control ---

    def _control(self, target: float, speed: float) -> Control:
        look = min(max(0.5 * speed + 2.5, 3.5), 11.0)
        aim = self._way[int(np.argmax(np.hypot(self._way[:, 0], self._way[:, 1]) > look))]
        forward, right = max(float(aim[0]), 0.5), float(aim[1]) + self._corridor.aside_m
        curvature = 2.0 * right / (forward * forward + right * right)
        steer = math.atan(_WHEELBASE_M * curvature) / _STEER_MAX_RAD
        missing = target - speed
        self._integral = min(max(self._integral + 0.05 * missing * _DT_S, 0.0), 0.15) if missing < 2.0 else 0.0
        throttle = min(max(0.35 * missing + self._integral, 0.0), 0.8) if missing > -0.3 else 0.0
        brake = min(max(-0.3 * (missing + 0.3), 0.0), 1.0)
        if target < 0.3:
            throttle, brake = 0.0, max(brake, 0.5)
        return Control(throttle=throttle, steer=min(max(steer, -1.0), 1.0), brake=brake)


def _line(course: Floats) -> tuple[float, float]:
    """(offset, slope) of a line through the first ten metres of a course, no farther off than a lane allows."""
    dx, dy = course[10] - course[0]
    slope = float(dy) / max(float(dx), 1.0)
    offset = float(course[0, 1]) - slope * float(course[0, 0])
    return min(max(offset, -_OFF_LANE_M), _OFF_LANE_M), slope
