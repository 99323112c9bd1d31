"""`expert`: a privileged rule-based planner, the upper end of every table.

It sees the ground truth (as PDM-Lite does in CARLA), forecasts everybody at constant speed, and takes the strongest
acceleration that stays out of trouble. Around things in its lane it goes when the forecast says that the way is free.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._forecast import lateral_target, project, rollouts
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath
from pytest_drive_robust.domain.truth import ActorKind, Frame, GroundTruth, LightState, StopLine

__all__ = ["Expert"]

Floats = NDArray[np.float64]

_WHEELBASE_M, _STEER_MAX_RAD = 2.85, 0.61
_ACCEL_MAX_MPS2, _BRAKE_MAX_MPS2 = 5.0, 8.0
_COMFORT_LATERAL_MPS2 = 2.8
_ACCELERATIONS = np.array([4.5, 2.3, 1.2, 0.6, 0.0, -0.8, -1.6, -2.6, -4.0, -6.0, -8.0])
_HORIZON_S = 5.0
_REACT_S = 0.4
_COMFORT_ACCEL_MPS2 = 2.3
_GAP_MPS = 7.0
_PATIENCE_S = 5.0
_MARGINS_M, _TIGHT_MARGINS_M = np.array([1.2, 0.7]), np.array([0.5, 0.3])
_PASS_HORIZON_S = 7.0
_LOOK_M = 45.0


@dataclass(slots=True)
class _Pass:
    """A way around something: the lateral plan of `_forecast.lateral_target`."""

    plan: Floats
    ends_row: float


class Expert:
    """Obeys lights and stop signs, waits for gaps, overtakes what stands at the edge of its lane, lets sirens past."""

    privileged = True
    consumes: frozenset[str] = frozenset()

    def __init__(self) -> None:
        self.reset(GlobalPlan(()), 0)

    def sensors(self) -> Sequence[CameraSpec]:
        """No cameras: it sees the ground truth."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode."""
        self._stopped_at: set[int] = set()
        self._pass: _Pass | None = None
        self._yielding = False
        self._waited_s = 0.0
        self._pushing = False
        self._limits: Floats | None = None
        self._box = np.array([math.inf, math.inf])
        self._path: tuple[tuple[float, float], ...] = ()

    def plan(self) -> PlannedPath:
        """The next 30 m of the path that the last control followed."""
        return PlannedPath(path=self._path)

    def act(self, observation: Observation) -> Control:
        """Plan on the ground truth. Raises `ValueError` when there is none (the loop gives it to privileged agents)."""
        truth = observation.truth
        if truth is None:
            raise ValueError("expert needs Observation.truth: it is a privileged agent")
        if self._limits is None:
            self._limits = _speed_profile(truth.route)
            self._box = _junction_rows(truth)
        ego = truth.frame.ego
        row, right = project(truth.route, truth.progress, ego.x_m, ego.y_m)
        actors = _actors(truth.frame)
        stop = self._stop_row(truth, row, ego.speed_mps)
        self._update_pass(truth, actors, row, right, stop)
        plan = self._pass.plan if self._pass is not None else _back_to_lane(row, right)
        acceleration = self._acceleration(truth, plan, row, actors, stop)
        return self._control(truth, plan, row, acceleration)

    # --- speed ---

    def _acceleration(self, truth: GroundTruth, plan: Floats, row: float, actors: Floats, stop: float) -> float:
        """The strongest acceleration that stays out of trouble; the one that keeps out longest when none does."""
        assert self._limits is not None
        ego = truth.frame.ego
        size = np.array([ego.length_m, ego.width_m])
        self._waited_s = self._waited_s + 0.05 if ego.speed_mps < 0.5 else 0.0
        pushy = self._waited_s > _PATIENCE_S or (self._pushing and ego.speed_mps < _GAP_MPS)
        self._pushing = pushy
        for margins in (_MARGINS_M, _TIGHT_MARGINS_M):
            state = (
                truth.route, plan, row, ego.speed_mps, size, actors, _ACCELERATIONS, self._limits, self._box, stop,
                margins, pushy, _HORIZON_S,
            )  # fmt: skip
            # going through must be safe to the end, or going on for a moment must leave the way to stop
            free = np.maximum(rollouts(*state, math.inf), rollouts(*state, _REACT_S))
            if free.max() >= _HORIZON_S - 1e-9:
                break
        limit = self._limits[int(np.clip(row + 0.3 * ego.speed_mps, 0, len(self._limits) - 1))]
        wanted = min(_COMFORT_ACCEL_MPS2, 1.2 * (limit - ego.speed_mps))
        safe = _ACCELERATIONS[free >= _HORIZON_S - 1e-9]
        if len(safe) == 0:
            return float(_ACCELERATIONS[int(np.argmax(free))]) if free.max() > 0.5 else -8.0
        gentle = safe[safe <= _COMFORT_ACCEL_MPS2]
        if ego.speed_mps < _GAP_MPS and safe[0] > _COMFORT_ACCEL_MPS2 and (len(gentle) == 0 or gentle[0] < 0.5):
            return float(safe[0])  # a gap that only a quick start can use
        return float(min(gentle[0], wanted)) if len(gentle) else float(safe[0])

    def _stop_row(self, truth: GroundTruth, row: float, speed_mps: float) -> float:
        """The route row that the front bumper must not pass: a red light, or a stop sign not yet honoured."""
        nearest = math.inf
        for line in truth.lane_map.stop_lines:
            at = _row_of_line(truth, line)
            if at is None or not -2.0 < at - row < 60.0:
                continue
            light = LightState(int(truth.frame.lights[line.index]))
            front = at - row - truth.frame.ego.length_m / 2.0
            if light is LightState.STOP_SIGN and line.index not in self._stopped_at:
                if speed_mps < 0.09 and front < 3.0:
                    self._stopped_at.add(line.index)
                else:
                    nearest = min(nearest, at - 0.4)
            can_stop = front > -0.3 and speed_mps * speed_mps / (2.0 * 7.0) < front + 0.5
            if light in (LightState.RED, LightState.YELLOW) and can_stop:
                nearest = min(nearest, at - 0.6)
        return nearest

    # --- ways around ---

    def _update_pass(self, truth: GroundTruth, actors: Floats, row: float, right: float, stop: float) -> None:
        if self._pass is not None and row > self._pass.ends_row:
            self._pass = None
        if self._let_past(truth, row, right):
            return
        ahead = _in_the_way(truth, row)
        if ahead is None or (self._pass is not None and not ahead.moving and self._pass.ends_row > ahead.last_row):
            return
        candidate = _around(ahead, row, right)
        if self._pass is not None or self._is_free(truth, candidate, row, actors, stop):
            self._pass = candidate

    def _is_free(self, truth: GroundTruth, candidate: _Pass, row: float, actors: Floats, stop: float) -> bool:
        """Can the whole manoeuvre be driven at some forward acceleration?"""
        assert self._limits is not None
        ego = truth.frame.ego
        size = np.array([ego.length_m, ego.width_m])
        forward = np.array([2.3, 1.2, 0.0]) if ego.speed_mps > 4.0 else np.array([2.3])
        free = rollouts(
            truth.route, candidate.plan, row, ego.speed_mps, size, actors, forward, self._limits, self._box, stop,
            _MARGINS_M, False, _PASS_HORIZON_S, math.inf,
        )  # fmt: skip
        return bool((free >= _PASS_HORIZON_S - 1e-9).any())

    def _let_past(self, truth: GroundTruth, row: float, right: float) -> bool:
        """Free the lane for a siren behind; True while that decides the lateral plan."""
        siren = _siren(truth)
        if siren is None:
            self._yielding = False
            return False
        behind_m, width_m = siren
        if not self._yielding and -60.0 < behind_m < -3.0:
            self._yielding = True
            hold = 22.0 + 12.0
            self._pass = _Pass(
                np.array([row, right, row + 22.0, width_m, row + hold + 200.0, row + hold + 215.0, 0.0]), row + 260.0
            )
        elif self._yielding and behind_m > 12.0:
            self._yielding = False
            self._pass = _Pass(np.array([row, right, row + 1.0, right, row + 2.0, row + 26.0, 0.0]), row + 30.0)
        return self._yielding

    # --- control ---

    def _control(self, truth: GroundTruth, plan: Floats, row: float, acceleration: float) -> Control:
        ego = truth.frame.ego
        look = float(np.clip(0.55 * ego.speed_mps + 2.5, 3.5, 13.0))
        local = [_local(truth, plan, row + ahead) for ahead in (look, *range(2, 32, 2))]
        self._path = tuple(local[1:])
        forward, right = local[0]
        curvature = 2.0 * right / max(forward * forward + right * right, 1.0)
        steer = math.atan(_WHEELBASE_M * curvature) / _STEER_MAX_RAD
        drag = 0.12 + 0.018 * ego.speed_mps + 0.0006 * ego.speed_mps**2
        push = acceleration + drag
        engine = min(_ACCEL_MAX_MPS2, 55.0 / max(ego.speed_mps, 1.0))
        standing = acceleration < -0.1 and ego.speed_mps < 0.3
        return Control(
            throttle=float(np.clip(push / engine, 0.0, 1.0)) if not standing else 0.0,
            steer=float(np.clip(steer, -1.0, 1.0)),
            brake=0.5 if standing else float(np.clip(-push / _BRAKE_MAX_MPS2, 0.0, 1.0)),
        )


@dataclass(frozen=True, slots=True)
class _Obstacle:
    first_row: float
    last_row: float
    left_edge_m: float
    moving: bool
    speed_mps: float


def _actors(frame: Frame) -> Floats:
    """(k, 6) for the forecast: x, y, yaw, speed, length, width."""
    rows = frame.actors
    return np.ascontiguousarray(
        rows[:, [Frame.X, Frame.Y, Frame.YAW, Frame.SPEED, Frame.LENGTH, Frame.WIDTH]], dtype=np.float64
    )


def _speed_profile(route: Floats) -> Floats:
    """The speed limit of each row, lowered for curves (comfortable lateral acceleration) and smoothed for braking."""
    turn = np.abs(np.gradient(np.unwrap(route[:, 2])))
    smooth = np.convolve(np.pad(turn, 3, mode="edge"), np.ones(7) / 7.0, mode="valid")
    limits: Floats = np.minimum(route[:, 3], np.sqrt(_COMFORT_LATERAL_MPS2 / np.maximum(smooth, 1e-4)))
    for k in range(len(limits) - 2, -1, -1):
        limits[k] = min(limits[k], math.sqrt(limits[k + 1] ** 2 + 2.0 * 1.8))
    return limits


def _junction_rows(truth: GroundTruth) -> Floats:
    """(first, last) row of the route on a junction lane, infinity when there is none."""
    inside = np.zeros(len(truth.route), dtype=bool)
    for lane in truth.lane_map.lanes:
        if not lane.junction:
            continue
        away = np.hypot(truth.route[:, None, 0] - lane.centre[:, 0], truth.route[:, None, 1] - lane.centre[:, 1])
        nearest = away.argmin(axis=1)
        aligned = np.cos(lane.centre[nearest, 2] - truth.route[:, 2]) > 0.97
        inside |= (away.min(axis=1) < 0.5) & aligned
    rows = np.flatnonzero(inside)
    return np.array([rows[0], rows[-1]], dtype=float) if len(rows) else np.array([math.inf, math.inf])


def _row_of_line(truth: GroundTruth, line: StopLine) -> float | None:
    """The route row where a stop line lies, or None when it is not on the route."""
    away = np.hypot(truth.route[:, 0] - line.x_m, truth.route[:, 1] - line.y_m)
    k = int(np.argmin(away))
    if away[k] > 1.5 or math.cos(truth.route[k, 2] - line.heading_rad) < 0.7:
        return None
    return float(k)


def _in_the_way(truth: GroundTruth, row: float) -> _Obstacle | None:
    """The nearest thing ahead that stands or crawls at the right edge of the ego's lane."""
    frame, found = truth.frame, None
    for actor in frame.actors:
        kind, speed = ActorKind(int(actor[Frame.KIND])), float(actor[Frame.SPEED])
        if kind is ActorKind.PEDESTRIAN or speed > 4.5:
            continue
        at, right = project(truth.route, int(max(row, 0.0)), float(actor[Frame.X]), float(actor[Frame.Y]))
        half_length, half_width = 0.5 * float(actor[Frame.LENGTH]), 0.5 * float(actor[Frame.WIDTH])
        left_edge = right - half_width
        in_lane = right > 0.4 and left_edge < frame.ego.width_m / 2.0 + 0.35
        ahead = at + half_length - row > -3.0 and at - half_length - row < _LOOK_M
        if not (in_lane and ahead):
            continue
        obstacle = _Obstacle(at - half_length, at + half_length, left_edge, speed > 0.5, speed)
        if found is None:
            found = obstacle
        elif obstacle.first_row < found.last_row + 14.0 and obstacle.last_row > found.first_row - 14.0:
            found = _Obstacle(
                min(found.first_row, obstacle.first_row),
                max(found.last_row, obstacle.last_row),
                min(found.left_edge_m, left_edge),
                found.moving or obstacle.moving,
                max(found.speed_mps, speed),
            )
        elif obstacle.first_row < found.first_row:
            found = obstacle
    return found


def _around(ahead: _Obstacle, row: float, right: float) -> _Pass:
    """Shift left until 0.75 m beside it, hold, come back; a moving thing is followed with the hold."""
    hold = min(ahead.left_edge_m - 0.75 - 0.92, 0.0)
    start = row
    at = max(row + 4.0, min(ahead.first_row - 5.0, row + 16.0))
    until = ahead.last_row + 5.0 + (4.0 * ahead.speed_mps if ahead.moving else 0.0)
    until = max(until, at + 1.0)
    return _Pass(np.array([start, right, at, hold, until, until + 14.0, 0.0]), until + 16.0)


def _back_to_lane(row: float, right: float) -> Floats:
    """No manoeuvre: return to the middle of the lane within a few metres."""
    return np.array([row, right, row + 12.0, 0.0, row + 1e6, row + 1e6 + 1.0, 0.0])


def _siren(truth: GroundTruth) -> tuple[float, float] | None:
    """(metres ahead of the ego, sideways metres that free the lane) of an emergency vehicle, or None."""
    frame, ego = truth.frame, truth.frame.ego
    for actor in frame.actors:
        if ActorKind(int(actor[Frame.KIND])) is not ActorKind.EMERGENCY:
            continue
        dx, dy = float(actor[Frame.X]) - ego.x_m, float(actor[Frame.Y]) - ego.y_m
        ahead = dx * math.cos(ego.yaw_rad) + dy * math.sin(ego.yaw_rad)
        return ahead, _free_side_m(truth)
    return None


def _free_side_m(truth: GroundTruth) -> float:
    """Width of the neighbour lane that leads the same way: to the right if there is one, else to the left."""
    x, y, yaw, _ = truth.route[truth.progress]
    best, chosen = math.inf, 3.0
    for lane in truth.lane_map.lanes:
        away = np.hypot(lane.centre[:, 0] - x, lane.centre[:, 1] - y)
        k = int(np.argmin(away))
        if away[k] < best and math.cos(lane.centre[k, 2] - yaw) > 0.7:
            best = float(away[k])
            to_right = lane.right >= 0 and lane.right_same_way and truth.lane_map.lanes[lane.right].kind == 0
            chosen = lane.width_m if to_right else -lane.width_m
    return chosen


def _local(truth: GroundTruth, plan: Floats, row: float) -> tuple[float, float]:
    """A place of the plan in the ego's frame: metres forward and to the right."""
    route, ego = truth.route, truth.frame.ego
    k = int(np.clip(row, 0, len(route) - 1))
    share = row - k
    yaw = route[k, 2]
    right = lateral_target(plan, row)
    x = route[k, 0] + share * math.cos(yaw) - right * math.sin(yaw) - ego.x_m
    y = route[k, 1] + share * math.sin(yaw) + right * math.cos(yaw) - ego.y_m
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    return x * c + y * s, -x * s + y * c
