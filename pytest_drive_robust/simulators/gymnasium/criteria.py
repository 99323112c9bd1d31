"""The leaderboard's criteria for a gymnasium environment: collisions, lanes, progress, and the end of an episode.

There are no lights, signs or scenarios to judge.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pytest_drive_robust.domain.outcome import End, Infraction
from pytest_drive_robust.domain.truth import ActorKind, LaneMap, WorldState
from pytest_drive_robust.simulators import criteria as limits
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions
from pytest_drive_robust.simulators.gymnasium.live_road import LiveRoad, kind_of
from pytest_drive_robust.simulators.gymnasium.route_line import RouteLine
from pytest_drive_robust.simulators.infractions import Here, closing_infractions, collision, end_detail


class EpisodeCriteria:
    """The state of the criteria in one episode; call `judge` once after every tick."""

    def __init__(
        self,
        road: LiveRoad,
        line: RouteLine,
        lane_map: LaneMap,
        index: dict[Any, int],
        *,
        dt_s: float,
        options: SimulatorOptions,
    ) -> None:
        self._dt_s = dt_s
        self._options = options
        self._road = road
        self._line = line
        self._lane_map = lane_map
        self._index = index
        self._infractions: list[Infraction] = []
        self._crashed = False
        self._off_road = False
        self._outside_m = 0.0
        self._off_route_m = 0.0
        self._still_s = 0.0
        self._checkpoint_m = 0.0
        self._speeds: list[tuple[float, float]] = []
        self._ratios: list[float] = []
        self._nearest = 0
        self.row = 0
        self.end: End | None = None

    @property
    def progress_m(self) -> float:
        """Metres of the route that are behind the ego."""
        return float(self._line.s[self.row])

    def judge(self, state: WorldState) -> None:
        """Judge the tick that ended with `state`."""
        gained = self._pass_rows(state)
        self._collisions(state)
        self._off_road = not self._road.ego.on_road
        if self._is_outside() or self._is_wrong_way(state):
            self._outside_m += gained
        self._efficiency(state)
        self._still_s = self._still_s + self._dt_s if state.ego.speed_mps < limits.STANDING_MPS else 0.0
        self.end = self._end(state)

    def score(self, state: WorldState) -> EpisodeScore:
        """Return the criteria of a finished episode, closed."""
        end, passed_m, here = self.end or End.SIMULATION_CRASHED, self.progress_m, self._here(state)
        outside_m = self._outside_m
        if end is End.ENVIRONMENT and self._off_road:
            outside_m = max(outside_m, 1.0)  # the environment stopped in the tick in which the ego left the road
        at_the_end = closing_infractions(
            end, outside_m=min(outside_m, passed_m), passed_m=passed_m, strayed=self._strayed, here=here
        )
        if passed_m > limits.LAST_CHECKPOINT_SHARE * self._line.length_m:
            self._close_checkpoint()
        stopped = "crashed" if self._crashed else "off the road" if self._off_road else "before the end of the route"
        return EpisodeScore(
            end=end,
            end_detail=end_detail(
                end,
                at_s=state.tick * self._dt_s,
                still_s=self._still_s,
                options=self._options,
                dt_s=self._dt_s,
                stopped=stopped,
            ),
            route_completion_pct=100.0 if end is End.COMPLETED else round(100.0 * passed_m / self._line.length_m, 2),
            route_length_m=self._line.length_m,
            infractions=(*self._infractions, *at_the_end),
            speed_ratios_pct=tuple(self._ratios),
            junction_passed=self._junction_passed(),
        )

    def _pass_rows(self, state: WorldState) -> float:
        rows, before = self._line.rows, self.row
        for k in range(before, min(before + limits.ROUTE_WINDOW, len(rows))):
            x, y, yaw = rows[k, :3]
            if (state.ego.x_m - x) * math.cos(yaw) + (state.ego.y_m - y) * math.sin(yaw) > 0.0:
                self.row = k
        return float(self._line.s[self.row] - self._line.s[before])

    def _collisions(self, state: WorldState) -> None:
        """Record one collision, unless the ego stood; highway-env's `crashed` stays true until the episode ends."""
        if self._road.ego.crashed and not self._crashed:
            self._crashed = True
            if self._road.speed_before_mps < limits.STANDING_MPS:
                return
            other = self._road.whom_it_hit()
            kind = ActorKind.BARRIER if other is None else kind_of(other)
            self._infractions.append(collision(kind, self._road.speed_before_mps, self._here(state)))

    def _is_outside(self) -> bool:
        """Return whether the ego is more than half a metre outside every lane (`ego.lane` is the nearest one)."""
        ego = self._road.ego
        if ego.lane.on_lane(ego.position, margin=limits.OUTSIDE_M):
            return False
        lanes = self._road.network.lanes_list()
        return not any(lane.on_lane(ego.position, margin=limits.OUTSIDE_M) for lane in lanes)

    def _is_wrong_way(self, state: WorldState) -> bool:
        """Return whether the ego drives against its nearest lane; junctions, where lanes cross, are left out."""
        ego = self._road.ego
        if self._lane_map.lanes[self._index[ego.lane_index]].junction:
            return False
        along = float(ego.lane.local_coordinates(ego.position)[0])
        turn = math.remainder(state.ego.yaw_rad - float(ego.lane.heading_at(along)), 2.0 * math.pi)
        return abs(turn) >= limits.WRONG_WAY_RAD

    def _efficiency(self, state: WorldState) -> None:
        """Compare the ego's mean speed with the traffic's, per twentieth of the route."""
        if self.progress_m - self._checkpoint_m > self._line.length_m / limits.CHECKPOINTS:
            self._checkpoint_m = self.progress_m
            self._close_checkpoint()  # this tick counts for the next one
        vehicles = state.actors[state.actors[:, WorldState.KIND] <= ActorKind.BICYCLE]
        if len(vehicles):
            self._speeds.append((state.ego.speed_mps, float(np.mean(vehicles[:, WorldState.SPEED]))))

    def _close_checkpoint(self) -> None:
        ego, traffic = (sum(column) for column in zip(*self._speeds, strict=True)) if self._speeds else (0.0, 0.0)
        self._ratios.append(round(100.0 * ego / traffic, 2) if traffic > 0.0 else 100.0)
        self._speeds.clear()

    def _off_route(self, state: WorldState) -> float:
        """Update the nearest row; return its distance [m] and count the metres of route that pass too far away."""
        ahead = self._line.rows[self._nearest : self._nearest + limits.DEVIATION_WINDOW]
        away = np.hypot(ahead[:, 0] - state.ego.x_m, ahead[:, 1] - state.ego.y_m)
        best, before = float(np.min(away)), self._nearest
        self._nearest += int(np.flatnonzero(away == best)[-1])
        if best >= limits.DEVIATION_SOFT_M:
            self._off_route_m += float(self._line.s[self._nearest] - self._line.s[before])
        return best

    @property
    def _strayed(self) -> bool:
        return self._off_route_m > limits.DEVIATION_SHARE * self._line.length_m

    def _end(self, state: WorldState) -> End | None:
        ego, last = state.ego, self._line.rows[-1]
        away = self._off_route(state)
        to_go = math.hypot(ego.x_m - last[0], ego.y_m - last[1])
        done = 100.0 * self.progress_m / self._line.length_m > limits.COMPLETE_PCT
        if to_go < limits.COMPLETE_M and not self._crashed and (done or (self._road.ended and not self._off_road)):
            return End.COMPLETED
        if away >= limits.DEVIATION_M or self._strayed:
            return End.DEVIATED
        if self._road.ended:
            return End.ENVIRONMENT
        if self._still_s > limits.BLOCKED_S:
            return End.BLOCKED
        stuck_stop_s = self._options.stuck_stop_s
        if stuck_stop_s is not None and self._still_s > stuck_stop_s:
            return End.STUCK
        return End.TICK_CAP if state.tick >= self._options.tick_cap else None

    def _junction_passed(self) -> bool:
        flags = [self._lane_map.lanes[self._index[key]].junction for key in self._line.keys]
        return any(flags) and self.row > flags.index(True) + limits.JUNCTION_PASSED_ROWS

    @staticmethod
    def _here(state: WorldState) -> Here:
        return state.tick, state.ego.x_m, state.ego.y_m
