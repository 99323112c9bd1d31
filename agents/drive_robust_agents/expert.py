"""`expert`: a privileged rule-based planner, the upper end of every table.

The expert sees the ground truth (as PDM-Lite does in CARLA) and drives in three steps, each with its own modules in
`_planning`:

1. forecast all actors along the lanes (`traffic`, `tracks`);
2. choose the path: the lanes of the route (`lane_changes`), or a way around obstacles (`obstacles`, `overtaking`); a
   new manoeuvre begins only when the forecast says that the manoeuvre can be completed;
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
from drive_robust_agents._planning.invader import InvaderAvoidance
from drive_robust_agents._planning.lane_changes import LaneChanges, Siren
from drive_robust_agents._planning.lateral import line_of
from drive_robust_agents._planning.obstacles import Obstacle
from drive_robust_agents._planning.overtaking import Overtaking
from drive_robust_agents._planning.projection import project
from drive_robust_agents._planning.right_of_way import RightOfWay
from drive_robust_agents._planning.situation import Situation
from drive_robust_agents._planning.speed import SpeedChoice, is_free
from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.traffic import Traffic
from drive_robust_agents._vehicle.mkz import TICK_S
from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, PlannedPath
from pytest_drive_robust.arithmetic.scalars import cos, sin, tan
from pytest_drive_robust.domain.truth import EgoState, GroundTruth
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.jit.arrays import Floats

__all__ = ["Expert"]

_CHANGE_FREE_S = 6.0
"""Seconds for which a lane, or the way out of a parking space, must be free."""
_PARKED_FROM_M = 1.5
"""Distance from the middle of its lane at which the ego starts from a parking space, and is out of its lane."""
_SLOWER = 0.9
"""Speed of an ego that waits for a gap, as a share of the speed of traffic in the new lane."""


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
        self._lanes: LaneChanges | None = None
        self._traffic = Traffic()
        self._right_of_way = RightOfWay(self._halt_s)
        self._siren, self._overtaking, self._invaders = Siren(), Overtaking(), InvaderAvoidance()
        self._speed = SpeedChoice()
        self._line: tuple[Floats, Floats] | None = None
        self._parked: bool | None = None
        self._held_back = False
        self._ego: EgoState | None = None
        self._intent: Intent | None = None
        self._tick: int | None = None

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
        if self._lanes is not None:
            memo[id(self._lanes.scene)] = self._lanes.scene.fork()
        return copy.deepcopy(self, memo)

    def act(self, observation: Observation) -> Control:
        """Return the control, planned on the ground truth. Raises `ValueError` without ground truth.

        The episode loop gives ground truth to privileged agents.
        """
        truth = observation.truth
        if truth is None:
            raise ValueError("expert needs Observation.truth: it is a privileged agent")
        if self._lanes is None:
            self._lanes = LaneChanges(StaticScene(truth))
        # a repeated tick counts as the next tick
        ticks = 1 if self._tick is None else max(1, observation.tick - self._tick)
        self._tick = observation.tick
        lanes, now = self._lanes, self._see(self._lanes.scene, truth, ticks)
        self._held_back = self._waits_beside_the_lane(lanes, now)
        if self._held_back:
            return self._control(truth.state.ego, lanes.profile, now, -1.0, now.stop_row)
        obstacle = self._choose_lane(lanes, now, truth)
        profile = self._profile(lanes, now, truth)
        stop = min(now.stop_row, lanes.stop_row(), self._overtaking.stop_row(obstacle, now))
        cruise = lanes.traffic_mps(self._traffic, now.row)
        acceleration = self._speed.choose(
            now,
            now.path(profile),
            stop,
            cruise_mps=math.inf if cruise is None else _SLOWER * cruise,
            hurry=self._hurries(lanes, profile, now),
        )
        self._held_back |= obstacle is not None and not obstacle.moving
        return self._control(truth.state.ego, profile, now, acceleration, stop)

    def _see(self, scene: StaticScene, truth: GroundTruth, ticks: int) -> Situation:
        """Return the data for all decisions of this tick."""
        world, ego = truth.state, truth.state.ego
        elapsed_s = TICK_S * ticks
        self._traffic.update(world, scene.graph, elapsed_s)
        row, right = project(scene.route, truth.progress - 6, truth.progress + 12, ego.x_m, ego.y_m)
        stop = self._right_of_way.stop_row(scene, world, row, elapsed_s=elapsed_s)
        turned = math.remainder(ego.yaw_rad - float(scene.route[scene.index(row), 2]), math.tau)
        return Situation(
            scene=scene, traffic=self._traffic, right_of_way=self._right_of_way,
            row=row, right_m=right, drift=tan(min(max(turned, -1.2), 1.2)), speed_mps=ego.speed_mps,
            stop_row=stop, ticks=ticks, room_s=self._room_s,
        )  # fmt: skip

    # --- where ---

    def _waits_beside_the_lane(self, lanes: LaneChanges, now: Situation) -> bool:
        """Return whether the ego still stands in a parking space because the way into the traffic is not free."""
        if self._parked is None:
            self._parked = abs(now.right_m - float(lanes.profile[0])) > _PARKED_FROM_M
        if self._parked:
            until_row = now.row + 40.0
            self._parked = not is_free(now, lanes.profile, until_row, within_s=_CHANGE_FREE_S, room_s=self._room_s)
        return self._parked

    def _choose_lane(self, lanes: LaneChanges, now: Situation, truth: GroundTruth) -> Obstacle | None:
        """Begin the manoeuvres that are possible now; return the obstacle before which the ego has to wait, or None."""
        self._overtaking.end(lanes.profile, now)
        for shift in self._siren.shifts(now.scene, self._traffic, truth.state, now.row):
            if is_free(now, lanes.profile + shift, now.row + 30.0):
                self._siren.step_aside(shift)
                break
        if self._siren.active:
            return None
        if self._overtaking.current is None:
            self._change_lane(lanes, now)
        return self._overtaking.begin(lanes.profile, now)

    def _change_lane(self, lanes: LaneChanges, now: Situation) -> None:
        """Begin the next lane change of the route if it is due and free."""
        candidate = lanes.candidate(now.row, now.speed_mps)
        if candidate is None:
            return
        if is_free(now, candidate, now.row + 90.0, within_s=_CHANGE_FREE_S):
            lanes.adopt(candidate)
        else:
            self._held_back = True

    def _profile(self, lanes: LaneChanges, now: Situation, truth: GroundTruth) -> Floats:
        """Return the profile of this tick: the lane's own, moved aside for a siren, an obstacle or an invader."""
        aside = self._siren.profile(self._traffic, truth.state)
        if aside is not None:
            return lanes.profile + aside
        if self._overtaking.current is not None:
            return lanes.profile + self._overtaking.current.shift
        return lanes.profile + self._invaders.shift_m(now)

    def _hurries(self, lanes: LaneChanges, profile: Floats, now: Situation) -> bool:
        """Return whether the ego leaves a parking space, is between two lanes, or is outside its own lane."""
        k, way = now.scene.index(now.row), self._overtaking.current
        passing = way is not None and abs(way.hold_m) > 1.0
        return passing or now.row < lanes.busy_until_row or abs(now.right_m - float(profile[k])) > _PARKED_FROM_M

    # --- control ---

    def _control(self, ego: EgoState, profile: Floats, now: Situation, acceleration: float, stop_row: float) -> Control:
        if self._line is None or self._line[0] is not profile:
            self._line = (profile, line_of(now.scene, profile))
        line = self._line[1]
        self._ego = ego
        self._intent = Intent(
            scene=now.scene, line=line, row=now.row, acceleration_mps2=acceleration,
            rule_row=now.stop_row, stop_row=stop_row,
            passing=self._overtaking.current is not None or self._siren.active, waiting=self._held_back,
        )  # fmt: skip
        steer = steer_along(ego, line, now.scene.index(now.row))
        return pedals(ego, acceleration, steer)
