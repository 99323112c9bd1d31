"""`classical`: a modular pipeline of the old school, with a channel for every perturbation to hurt.

Raw GPS and compass place the vehicle on a smooth path through the sparse plan. The camera corrects the path by the
lane's markings, finds bodies in the way, and detects lamps and stop signs (`_classical.vision`, which knows the palette
of its world). Two controllers compute steering and pedals. Inputs are filtered no more than in a deployed agent of this
kind: a noisy GPS reaches the steering wheel, a wrong speed the pedals, a frozen image everything.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from drive_robust_agents._classical.corridor import Corridor, beside
from drive_robust_agents._classical.gap import Gap
from drive_robust_agents._classical.junction_rules import FRONT_M, JunctionRules
from drive_robust_agents._classical.lane_tracker import LaneTracker
from drive_robust_agents._classical.overtake import Overtake
from drive_robust_agents._classical.plan_path import Junction, PlanPath
from drive_robust_agents._classical.vision import CAMERA, GroundModel
from drive_robust_agents._vehicle import mkz
from drive_robust_agents._vehicle.mkz import Pedals
from drive_robust_agents._vehicle.plain_car import pedals_from_plain
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath, RoadOption
from pytest_drive_robust.jit.arrays import Floats, Pixels

__all__ = ["Classical"]

_CRUISE_MPS, _TURN_MPS, _CAREFUL_MPS = 12.0, 6.5, 8.5
"""Speeds on a free road, in a turn, and straight over a junction or beside something at the edge."""
_BRAKE_MPS2, _STANDOFF_M = 3.6, 3.5
"""Deceleration for a body in the way, and the distance at which the front bumper stops before it."""
_LANE_SHARE = 0.85
"""Share of the distance to the middle of a well-seen lane by which the plan's course is moved."""
_OFF_LANE_M, _IN_LANE_M = 0.6, 0.8
"""Largest first guess of the lane's offset, and the offset from the plan below which the vehicle is in its lane."""
_PULL_OUT_MPS, _SLOW_MPS = 3.5, 1.0
"""Speed while changing sides, and the speed below which bodies beside the lane are looked at."""
_ROOM_TO_PULL_OUT_M, _ROAD_TO_PASS_M = 3.5, 30.0
"""Distance kept in addition before a body that may be passed, and the length of road without a junction to pass it."""
_AHEAD_POINTS = 44
"""Length of the way ahead, a point a metre."""


class Classical:
    """Drives by GPS, compass, speed and one front camera; stops for bodies in the way, and steps aside a little."""

    portable_bits = True
    consumes: frozenset[str] = frozenset({"cameras", "gps", "compass", "speed"})

    def __init__(self) -> None:
        self.reset(GlobalPlan(()), 0)

    def sensors(self) -> Sequence[CameraSpec]:
        """Return one camera at the front edge of the roof."""
        return (CAMERA,)

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode. The seed is not used: nothing is drawn."""
        self._plan = route
        self._path: PlanPath | None = None
        self._ground, self._lane, self._corridor = GroundModel(), LaneTracker(), Corridor()
        self._rules, self._overtake, self._gap = JunctionRules(), Overtake(), Gap()
        self._yaw_rad = 0.0
        self._tick: int | None = None
        self._on_road, self._entered, self._go = False, False, False
        self._may_pass, self._shift_m = False, 0.0
        self._integral = 0.0
        self._way: Floats = np.zeros((1, 2))

    def plan(self) -> PlannedPath:
        """Return the path that the last control followed."""
        return PlannedPath(path=tuple((float(x), float(y)) for x, y in self._way[1:31]))

    def act(self, observation: Observation) -> Control:
        """Return the control: perceive, choose a speed, steer."""
        yaw, speed = observation.compass.yaw_rad, observation.speed.mps
        if self._path is None:
            self._path, self._yaw_rad = PlanPath(self._plan, yaw), yaw
        pixels = observation.cameras[CAMERA.name].pixels
        ticks = 1 if self._tick is None else max(observation.tick - self._tick, 1)  # above 1 when controls are held
        self._tick = observation.tick
        elapsed_s = ticks * mkz.TICK_S
        travelled, turned = speed * elapsed_s, math.remainder(yaw - self._yaw_rad, math.tau)
        self._yaw_rad = yaw
        at = self._path.locate(observation.gps.x_m, observation.gps.y_m)
        junction = self._path.next_junction(at)
        course = self._path.ahead(observation.gps.x_m, observation.gps.y_m, yaw, _AHEAD_POINTS)
        self._entered |= abs(float(course[0, 1])) < _IN_LANE_M
        to_lane_end = self._path.to_lane_end(at)
        self._way = self._correct(course, pixels, to_lane_end, travelled, turned)
        inside = junction is not None and at > junction.entry_m - 3.0
        bases = self._ground.bases(pixels)
        self._may_pass = self._entered and to_lane_end > _ROAD_TO_PASS_M
        passing = self._pass(pixels, bases, speed, ticks)
        self._corridor.update(
            bases, self._way, travelled, elapsed_s,
            may_dodge=not inside and not passing, no_posts=inside, narrow=passing,
        )  # fmt: skip
        rules = self._rules.speed(pixels, bases, junction, at, speed, elapsed_s)
        target = min(self._road_speed(at, junction), self._obstacle_speed(), rules)
        return self._control(target, speed, elapsed_s)

    def _correct(self, course: Floats, pixels: Pixels, to_lane_end: float, travelled: float, turned: float) -> Floats:
        """Return the plan's course moved to the middle of the seen lane, on stretches where the path keeps its lane."""
        on_road = to_lane_end > -1.0 and self._entered
        if on_road and not self._on_road:
            self._lane.forget(*_line(course, _OFF_LANE_M))
        self._on_road = on_road
        way: Floats = course.copy()
        if self._overtake.offset_m < 0.0:  # the markings belong to another lane: keep the last correction
            way[:, 1] += self._shift_m
            self._lane.forget(*_line(way, math.inf))
        elif on_road:
            self._lane.move(travelled, turned)
            self._lane.see(pixels, self._ground.brightness(LaneTracker.FORWARD_M))
            share = _LANE_SHARE * min(self._lane.quality / 0.3, 1.0)
            shift = share * (self._lane.middle(course[:, 0]) - course[:, 1])
            beyond = np.maximum(np.arange(len(course)) - to_lane_end, 0.0)
            way[:, 1] += np.clip(shift, -4.0, 4.0) * np.maximum(0.0, 1.0 - beyond / 8.0)
            self._shift_m = float(way[6, 1] - course[6, 1])
        return way

    def _pass(self, pixels: Pixels, bases: Floats, speed: float, ticks: int) -> bool:
        """Move the way to the left of a body in the lane; return True while the way is moved."""
        matters = self._overtake.passing or speed < _SLOW_MPS or not self._entered
        along, right = beside(bases if matters else bases[:0], self._way).T
        if not self._entered and not self._go:
            self._go = self._gap.open(along[np.abs(right) < _IN_LANE_M + 0.9], pixels, ticks)
        self._overtake.update(pixels, along, right, speed_mps=speed, ticks=ticks, allowed=self._may_pass)
        self._way[:, 1] += self._overtake.offsets(len(self._way))
        return self._overtake.offset_m < 0.0

    # --- speed ---

    def _road_speed(self, at: float, junction: Junction | None) -> float:
        """Return the cruising speed, lower for a turn ahead and beside things at the edge."""
        target = _CAREFUL_MPS if self._corridor.tight or self._corridor.aside_m < -0.2 else _CRUISE_MPS
        if self._overtake.offset_m < 0.0 or not self._entered:
            slanted = abs(float(self._way[4, 1])) > 0.6
            target = _PULL_OUT_MPS if slanted else _CAREFUL_MPS
        if not self._entered and not self._go:
            target = 0.0
        if junction is not None:
            turn = _TURN_MPS if junction.command is not RoadOption.STRAIGHT else _CAREFUL_MPS
            target = min(target, math.sqrt(turn * turn + 2.0 * 1.8 * max(junction.entry_m - at, 0.0)))
        return target

    def _obstacle_speed(self) -> float:
        far = _ROOM_TO_PULL_OUT_M if self._may_pass and not self._overtake.passing else 0.0
        gap = self._corridor.free_m - FRONT_M - _STANDOFF_M - far
        return math.sqrt(2.0 * _BRAKE_MPS2 * gap) if gap > 0.0 else 0.0

    # --- control ---

    def _control(self, target: float, speed: float, elapsed_s: float) -> Control:
        """Return the control: pure pursuit of a point of the way, and a PI controller of the speed."""
        ahead, aside = self._aim(min(max(0.5 * speed + 2.5, 3.5), 11.0))
        forward, right = max(ahead, 0.5), aside + self._corridor.aside_m
        curvature = 2.0 * right / (forward * forward + right * right)
        steer = mkz.steer(curvature)
        missing = target - speed
        self._integral = min(max(self._integral + 0.05 * missing * elapsed_s, 0.0), 0.15) if missing < 2.0 else 0.0
        throttle = min(max(0.35 * missing + self._integral, 0.0), 0.8) if missing > -0.3 else 0.0
        brake = min(max(-0.3 * (missing + 0.3), 0.0), 1.0)
        if target < 0.3:
            throttle, brake = 0.0, max(brake, 0.5)
        throttle, brake = pedals_from_plain(speed, Pedals(throttle, brake))
        return Control(throttle=throttle, steer=steer, brake=brake)

    def _aim(self, look_m: float) -> tuple[float, float]:
        """Return the first point of the way farther away than `look_m`, or the way's first point if none is."""
        for ahead, aside in self._way.tolist():
            if ahead * ahead + aside * aside > look_m * look_m:
                return ahead, aside
        return float(self._way[0, 0]), float(self._way[0, 1])


def _line(course: Floats, most_m: float) -> tuple[float, float]:
    """Return (offset, slope) of a line through the first ten metres of a course, the offset limited to `most_m`."""
    dx, dy = course[10] - course[0]
    slope = float(dy) / max(float(dx), 1.0)
    offset = float(course[0, 1]) - slope * float(course[0, 0])
    return min(max(offset, -most_m), most_m), slope
