"""`expert`: a privileged rule-based planner, the upper end of every table.

The expert sees the ground truth (as PDM-Lite does in CARLA) and drives in three steps, each with its own modules in
`_planning`:

1. forecast all actors along the lanes (`traffic`, `tracks`);
2. choose the path: the lanes of the route (`lane_changes`), or a way around obstacles (`obstacles`); a new manoeuvre
   begins only when the forecast says that the manoeuvre can be completed;
3. choose the speed: the strongest acceleration without trouble (`speed`, `forecast`), given the places where lights,
   signs and junctions make the ego wait (`right_of_way`).

The expert knows no actor's intentions, and learns the ways of traffic at forks by watching. The expert reads the tick
of each observation. When it acts only every few ticks, as under latency in the mode `hold`, it still knows the
accelerations and standing times of all actors.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

from drive_robust_agents._planning.control import pedals, steer_along
from drive_robust_agents._planning.intent import Intent
from drive_robust_agents._planning.invader import invader_edge
from drive_robust_agents._planning.lane_changes import LaneChanges, Siren
from drive_robust_agents._planning.lateral import line_of
from drive_robust_agents._planning.obstacles import Obstacle, Pass, nearest_obstacle, ways_around
from drive_robust_agents._planning.projection import project
from drive_robust_agents._planning.right_of_way import RightOfWay
from drive_robust_agents._planning.speed import Situation, SpeedChoice, is_free
from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.traffic import Traffic
from drive_robust_agents._vehicle.mkz import TICK_S
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath
from pytest_drive_robust.arithmetic.scalars import cos, sin, tan
from pytest_drive_robust.domain.truth import EgoState, GroundTruth
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Expert"]

_WAIT_BEFORE_M = 7.0
"""Distance at which the front bumper stops before an obstacle, which leaves room for the way around."""
_CHANGE_FREE_S = 6.0
_PASS_EARLY_M, _PASS_LOOK_M, _DOUBTS = 10.0, 90.0, 6
_PARKED_FROM_M = 1.5
_NEAR_M, _NEAR_S, _BORROW_AFTER_S = (10.0, 30.0), 3.0, 5.1
"""Distances and time at which the ego counts as near an obstacle (within 3 s at its speed, limited to 10..30 m), and
the seconds after which the oncoming lane is free then (all scenarios with `TwoWays` in Bench2Drive)."""
_HALT_MPS2 = 4.0
"""Deceleration to stop when the ego is nearer than `_WAIT_BEFORE_M` already."""
_SLOWER = 0.9
"""Speed of an ego that waits for a gap, as a share of the speed of traffic in the new lane."""
_INVADER_GAP_M, _INVADER_TICKS = 0.5, 600
_EDGE_M = 0.3
"""Distance beyond the right edge of its lane to which the ego moves to avoid an invader."""


class Expert:
    """Obeys lights and stop signs, waits for gaps, changes lanes, overtakes obstacles, lets sirens past.

    `room_s` is the additional time in seconds left to actors whose way the ego crosses, `halt_s` the time of a stop at
    a stop sign. The expert needs neither, because it knows the exact places of all actors; agents that learn from it
    by looking need both (`training.data.expert_episode`). Raises `UsageError` for seconds that are not finite and at
    least 0.
    """

    privileged = True
    portable_bits = True
    consumes: frozenset[str] = frozenset()

    def __init__(self, *, room_s: float = 0.0, halt_s: float = 0.0) -> None:
        self.check(room_s=room_s, halt_s=halt_s)
        self._room_s, self._halt_s = room_s, halt_s
        self.reset(GlobalPlan(()), 0)

    @classmethod
    def check(cls, *, room_s: float = 0.0, halt_s: float = 0.0) -> None:
        """Raise `UsageError` for seconds that are not finite and at least 0."""
        for name, seconds in (("room_s", room_s), ("halt_s", halt_s)):
            if not 0.0 <= seconds < math.inf:
                raise UsageError(f"expert has {name}={seconds!r}, expected seconds from 0 on, as in 'expert:{name}=1'.")

    def sensors(self) -> Sequence[CameraSpec]:
        """Return no cameras: it sees the ground truth."""
        return ()

    def reset(self, route: GlobalPlan, seed: int) -> None:
        """Forget the last episode."""
        self._scene: StaticScene | None = None
        self._lanes: LaneChanges | None = None
        self._traffic = Traffic()
        self._right_of_way = RightOfWay(self._halt_s)
        self._siren = Siren()
        self._speed = SpeedChoice()
        self._pass: Pass | None = None
        self._line: tuple[Floats, Floats] | None = None
        self._doubts = 0
        self._near_s = 0.0
        self._aside_m, self._aside_ticks = 0.0, 0
        self._parked: bool | None = None
        self._ego: EgoState | None = None
        self._held_back = False
        self._intent: Intent | None = None
        self._tick: int | None = None
        self._ticks = 1

    def plan(self) -> PlannedPath:
        """Return the next 30 m of the path that the last control followed."""
        if self._intent is None or self._ego is None:
            return PlannedPath()
        ego, row = self._ego, self._intent.scene.index(self._intent.row)
        c, s = cos(ego.yaw_rad), sin(ego.yaw_rad)
        ahead = (self._intent.line[row + 2 : row + 32 : 2, :2] - (ego.x_m, ego.y_m)).tolist()
        return PlannedPath(path=tuple((x * c + y * s, y * c - x * s) for x, y in ahead))

    def intent(self) -> Intent:
        """Return the reasons of the last control. Raises `ValueError` before the first control of an episode."""
        if self._intent is None:
            raise ValueError("the expert has not acted yet in this episode: call act(observation) first")
        return self._intent

    def fork(self) -> Expert:
        """Return an independent copy of the expert in its present state.

        Both share the map, which does not change.
        """
        memo: dict[int, object] = {}
        if self._scene is not None:
            memo[id(self._scene)] = self._scene.fork()
        return copy.deepcopy(self, memo)

    def act(self, observation: Observation) -> Control:
        """Return the control, planned on the ground truth. Raises `ValueError` without ground truth.

        The episode loop gives ground truth to privileged agents.
        """
        truth = observation.truth
        if truth is None:
            raise ValueError("expert needs Observation.truth: it is a privileged agent")
        if self._scene is None:
            self._scene = StaticScene(truth)
            self._lanes = LaneChanges(self._scene)
        assert self._lanes is not None
        # a repeated tick counts as the next tick
        self._ticks = 1 if self._tick is None else max(1, observation.tick - self._tick)
        self._tick = observation.tick
        now = self._see(self._scene, truth)
        self._held_back = self._waits_beside_the_lane(self._lanes, now)
        if self._held_back:
            return self._control(truth.state.ego, self._lanes.profile, now, -1.0, now.stop_row)
        obstacle = self._choose_lane(self._lanes, now, truth)
        profile = self._profile(self._lanes, now, truth)
        stop = min(now.stop_row, self._lanes.stop_row(), self._before(obstacle, now))
        cruise = self._lanes.traffic_mps(self._traffic, now.row)
        acceleration = self._speed.choose(
            now,
            now.path(profile),
            stop,
            cruise_mps=math.inf if cruise is None else _SLOWER * cruise,
            hurry=self._hurries(self._lanes, profile, now),
        )
        self._held_back |= obstacle is not None and not obstacle.moving
        return self._control(truth.state.ego, profile, now, acceleration, stop)

    def _see(self, scene: StaticScene, truth: GroundTruth) -> Situation:
        """Return the data for all decisions of this tick."""
        world, ego = truth.state, truth.state.ego
        elapsed_s = TICK_S * self._ticks
        self._traffic.update(world, scene.graph, elapsed_s)
        row, right = project(scene.route, truth.progress - 6, truth.progress + 12, ego.x_m, ego.y_m)
        stop = self._right_of_way.stop_row(scene, world, row, elapsed_s=elapsed_s)
        turned = math.remainder(ego.yaw_rad - float(scene.route[scene.index(row), 2]), math.tau)
        drift = tan(min(max(turned, -1.2), 1.2))
        return Situation(
            scene, self._traffic, self._right_of_way, row, right, drift, ego.speed_mps, stop, elapsed_s, self._room_s
        )

    # --- where ---

    def _waits_beside_the_lane(self, lanes: LaneChanges, now: Situation) -> bool:
        """Return whether the ego still stands in a parking space because the way into the traffic is not free."""
        if self._parked is None:
            self._parked = abs(now.right_m - float(lanes.profile[0])) > _PARKED_FROM_M
        if self._parked:
            self._parked = not is_free(
                now, now.path(lanes.profile), now.row + 40.0, within_s=_CHANGE_FREE_S, room_s=self._room_s
            )
        return self._parked

    def _choose_lane(self, lanes: LaneChanges, now: Situation, truth: GroundTruth) -> Obstacle | None:
        """Begin the manoeuvres that are possible now; return the obstacle before which the ego has to wait, or None."""
        if self._pass is not None and (now.row > self._pass.ends_row or self._give_up(lanes, now)):
            self._pass = None
        for shift in self._siren.shifts(now.scene, self._traffic, truth.state, now.row):
            if self._is_free(lanes.profile + shift, now, now.row + 30.0):
                self._siren.step_aside(shift)
                break
        if self._siren.active:
            return None
        self._change_lane(lanes, now)
        return self._go_around(lanes, now)

    def _change_lane(self, lanes: LaneChanges, now: Situation) -> None:
        if self._pass is not None:
            return
        candidate = lanes.candidate(now.row, now.speed_mps)
        if candidate is None:
            return
        if self._is_free(candidate, now, now.row + 90.0, within_s=_CHANGE_FREE_S):
            lanes.adopt(candidate)
        else:
            self._held_back = True

    def _go_around(self, lanes: LaneChanges, now: Situation) -> Obstacle | None:
        """Begin to pass an obstacle in the lane; return the obstacle while the way around is not free."""
        ahead = nearest_obstacle(now.scene, self._traffic, lanes.profile, now.row)
        if ahead is None:
            self._near_s = 0.0
            return None
        self._watch(ahead, now)
        if self._pass is not None and (not ahead.moving and self._pass.ends_row > ahead.last_row):
            return None
        k = min(now.scene.index(now.row), now.scene.count - 2)
        lane_m = float(lanes.profile[k] + (now.row - k) * (lanes.profile[k + 1] - lanes.profile[k]))
        for way in ways_around(now.scene, ahead, now.row, now.right_m - lane_m, speed_mps=now.speed_mps):
            until = min(way.ends_row, now.row + _PASS_LOOK_M)
            if self._pass is None and way.starts_row > now.row + _PASS_EARLY_M:
                continue
            if self._pass is None and way.oncoming and self._near_s < _BORROW_AFTER_S:
                continue
            if self._pass is not None or self._is_free(lanes.profile + way.shift, now, until):
                self._pass = way
                self._doubts = 0
                return None
        return ahead

    def _watch(self, ahead: Obstacle, now: Situation) -> None:
        """Count the seconds since the ego came near the obstacle."""
        near_m = min(max(_NEAR_S * now.speed_mps, _NEAR_M[0]), _NEAR_M[1])
        if self._near_s > 0.0 or ahead.first_row - now.row < near_m:
            self._near_s += now.elapsed_s

    def _give_up(self, lanes: LaneChanges, now: Situation) -> bool:
        """Return whether a pass from which the ego can still stop is no longer free for several ticks on end."""
        if self._pass is None or now.row + _halt_m(now) > self._pass.beside_row:
            return False
        until = min(self._pass.ends_row, now.row + _PASS_LOOK_M)
        free = self._is_free(lanes.profile + self._pass.shift, now, until)
        self._doubts = 0 if free else self._doubts + self._ticks if self._doubts else 1
        return self._doubts > _DOUBTS

    def _is_free(self, profile: Floats, now: Situation, until_row: float, *, within_s: float = math.inf) -> bool:
        return is_free(now, now.path(profile), until_row, within_s=within_s)

    def _profile(self, lanes: LaneChanges, now: Situation, truth: GroundTruth) -> Floats:
        """Return the profile of this tick: the lane's own, moved aside for a siren, an obstacle or an invader."""
        aside = self._siren.profile(self._traffic, truth.state)
        if aside is not None:
            return lanes.profile + aside
        if self._pass is not None:
            return lanes.profile + self._pass.shift
        return lanes.profile + self._keep_right(now)

    def _keep_right(self, now: Situation) -> float:
        """Return metres to move right while an invader reaches into the lane, and for `_INVADER_TICKS` afterwards."""
        scene = now.scene
        half_lane = 0.5 * scene.lane_at(now.row).width_m
        edge = invader_edge(scene, self._traffic.boxes, now.row, half_lane)
        if edge is not None:
            need = edge + scene.half_width_m + _INVADER_GAP_M
            self._aside_m = max(self._aside_m, min(need, half_lane - scene.half_width_m + _EDGE_M))
            self._aside_ticks = _INVADER_TICKS
        self._aside_ticks -= self._ticks
        return self._aside_m if self._aside_ticks > 0 else 0.0

    def _hurries(self, lanes: LaneChanges, profile: Floats, now: Situation) -> bool:
        """Return whether the ego leaves a parking space, is between two lanes, or is outside its own lane."""
        k = now.scene.index(now.row)
        passing = self._pass is not None and abs(self._pass.hold_m) > 1.0
        return passing or now.row < lanes.busy_until_row or abs(now.right_m - float(profile[k])) > _PARKED_FROM_M

    def _before(self, obstacle: Obstacle | None, now: Situation) -> float:
        """Return the row at which the front bumper waits for a way around, infinite without an obstacle."""
        if obstacle is None or (obstacle.moving and self._near_s >= _BORROW_AFTER_S):
            return math.inf
        front = now.row + now.scene.half_length_m
        wait = obstacle.first_row - _WAIT_BEFORE_M
        if front < wait + 0.3:
            return wait
        return front if now.speed_mps < 1.0 else min(front + _halt_m(now), obstacle.first_row - 1.0)

    # --- control ---

    def _control(self, ego: EgoState, profile: Floats, now: Situation, acceleration: float, stop_row: float) -> Control:
        if self._line is None or self._line[0] is not profile:
            self._line = (profile, line_of(now.scene, profile))
        line = self._line[1]
        self._ego = ego
        passing = self._pass is not None or self._siren.active
        self._intent = Intent(now.scene, line, now.row, acceleration, now.stop_row, stop_row, passing, self._held_back)
        steer = steer_along(ego, line, now.scene.index(now.row))
        return pedals(ego, acceleration, steer)


def _halt_m(now: Situation) -> float:
    return now.speed_mps * now.speed_mps / (2.0 * _HALT_MPS2)
