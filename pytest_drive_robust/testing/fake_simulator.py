"""A deterministic world of one straight road: small enough to read, complete enough to test everything around it."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.arithmetic import scalars
from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Compass, Gps, Image, Imu, Observation, Speed
from pytest_drive_robust.domain.outcome import End, Infraction
from pytest_drive_robust.domain.route import (
    GlobalPlan,
    PlanPoint,
    RoadOption,
    Route,
    ScenarioSpec,
    TriggerPoint,
    Waypoint,
)
from pytest_drive_robust.domain.truth import EgoState, GroundTruth, Lane, LaneKind, LaneMap, WorldState
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions

_WHEELBASE_M = 2.8
_LARGEST_STEER_RAD = 0.6
_ROAD_HALF_WIDTH_M = 10.0
_SPEED_LIMIT_MPS = 13.9
_START = EgoState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, length_m=4.5, width_m=1.9)


def fake_route(route_id: str = "1", *, length_m: float = 60.0) -> Route:
    """Return a route for `FakeSimulator`: `length_m` metres straight ahead."""
    scenario = ScenarioSpec("Straight_1", "Straight", TriggerPoint(length_m / 2.0, 0.0, 0.0, 0.0))
    return Route(route_id, "Straight", (Waypoint(0.0, 0.0), Waypoint(length_m, 0.0)), scenario)


@dataclass
class FakeSimulator:
    """A straight road along x, a parked car at a place drawn by route id and seed, and an ego with simple physics.

    Tests can make the simulator fail: the method `raises_in` (`"reset"`, `"observe"`, `"step"`, `"score"`) raises
    `raises` from tick `raises_at` on; the episode ends with `ends` in tick `ends_at`; `score` reports `infractions` as
    given. An episode ends as `COMPLETED` at the route's last waypoint, as `DEVIATED` more than 10 m beside the middle
    of the road, and as `TICK_CAP` or `STUCK` by `options`. Each camera has one buffer of pixels, which is overwritten,
    as the protocol allows.
    """

    options: SimulatorOptions = field(default_factory=SimulatorOptions)
    infractions: tuple[Infraction, ...] = ()
    ends: End | None = None
    ends_at: int = 0
    raises: Exception | None = None
    raises_in: str = "step"
    raises_at: int = 0

    name: str = field(default="fake", init=False)
    version: str = field(default="1", init=False)
    dt_s: float = field(default=0.05, init=False)

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        """Put the ego at the origin; the route is as long as the way from its first to its last waypoint."""
        self._tick = 0
        self._maybe_raise("reset")
        first, last = route.waypoints[0], route.waypoints[-1]
        self._length_m = scalars.hypot(last.x_m - first.x_m, last.y_m - first.y_m)
        self._ego = _START
        self._stood_s = 0.0
        self._cameras = tuple(cameras)
        self._buffers = {
            camera.name: np.zeros((camera.height_px, camera.width_px, 3), dtype=np.uint8) for camera in cameras
        }
        self._captured = dict.fromkeys(self._buffers, 0)
        parked_x_m = random.Random(f"{route.id} {seed}".encode("utf-8", "surrogatepass")).uniform(10.0, 50.0)
        self._actors = np.array([[7.0, 0.0, parked_x_m, 4.0, 0.0, 0.0, 4.5, 1.9, 1.5, 0.0]])
        return self._state()

    def plan(self) -> GlobalPlan:
        """Return a point every 50 m and one at the end, all `LANE_FOLLOW`."""
        stops_m = [*np.arange(0.0, self._length_m, 50.0).tolist(), self._length_m]
        return GlobalPlan(tuple(PlanPoint(x_m, 0.0, RoadOption.LANE_FOLLOW) for x_m in stops_m))

    def observe(self) -> Observation:
        """Return the signals without noise.

        In each image red shows the ego's x, green the distance to the parked car, blue the row.
        """
        self._maybe_raise("observe")
        ego, tick = self._ego, self._tick
        for camera in self._cameras:
            if tick % round(1.0 / (self.dt_s * camera.rate_hz)) == 0:
                self._draw(camera)
        return Observation(
            tick=tick,
            gps=Gps(ego.x_m, ego.y_m, tick),
            compass=Compass(ego.yaw_rad + math.pi / 2.0, tick),
            imu=Imu(ego.forward_mps2, ego.right_mps2, ego.yaw_rate_radps, tick),
            speed=Speed(ego.speed_mps, tick),
            cameras={name: Image(pixels, self._captured[name]) for name, pixels in self._buffers.items()},
        )

    def truth(self) -> GroundTruth:
        """Return the state, the one lane, and the route with one row for each metre."""
        x_m = np.arange(0.0, self._length_m + 1.0)
        zeros = np.zeros_like(x_m)
        rows = np.column_stack([x_m, zeros, zeros, np.full_like(x_m, _SPEED_LIMIT_MPS)])
        return GroundTruth(self._state(), _lane_map(x_m), rows, min(int(self.progress_m), len(x_m) - 1))

    def step(self, control: Control) -> WorldState:
        """Advance one tick: throttle up to 3 m/s2, brake up to 8 m/s2, rolling 0.05 m/s2 per m/s; never backwards."""
        self._maybe_raise("step")
        ego, dt = self._ego, self.dt_s
        wanted = ego.speed_mps + dt * (3.0 * control.throttle - 8.0 * control.brake - 0.05 * ego.speed_mps)
        speed = max(wanted, 0.0)
        yaw_rate = speed / _WHEELBASE_M * scalars.tan(_LARGEST_STEER_RAD * control.steer)
        yaw = ego.yaw_rad + dt * yaw_rate
        self._ego = replace(
            ego,
            x_m=ego.x_m + dt * speed * scalars.cos(yaw),
            y_m=ego.y_m + dt * speed * scalars.sin(yaw),
            yaw_rad=yaw,
            speed_mps=speed,
            forward_mps2=(speed - ego.speed_mps) / dt,
            right_mps2=speed * yaw_rate,
            yaw_rate_radps=yaw_rate,
        )
        self._stood_s = self._stood_s + dt if speed < 0.1 else 0.0
        self._tick += 1
        return self._state()

    @property
    def done(self) -> End | None:
        """The end of the episode or None: `ends` first, then an end by the ego's place, then `STUCK` and `TICK_CAP`."""
        if self.ends is not None and self._tick >= self.ends_at:
            return self.ends
        if self._ego.x_m >= self._length_m:
            return End.COMPLETED
        if abs(self._ego.y_m) > _ROAD_HALF_WIDTH_M:
            return End.DEVIATED
        if self.options.stuck_stop_s is not None and self._stood_s >= self.options.stuck_stop_s:
            return End.STUCK
        return End.TICK_CAP if self._tick >= self.options.tick_cap else None

    @property
    def progress_m(self) -> float:
        """Progress along the route in metres: the ego's x, limited to the route."""
        return min(max(self._ego.x_m, 0.0), self._length_m)

    def score(self) -> EpisodeScore:
        """Return the score: the driven share of the route, and `infractions` as given."""
        self._maybe_raise("score")
        end = self.done or End.TICK_CAP
        return EpisodeScore(
            end=end,
            end_detail=f"{end.value} after {self._tick} ticks",
            route_completion_pct=100.0 * self.progress_m / self._length_m,
            route_length_m=self._length_m,
            infractions=self.infractions,
            speed_ratios_pct=(),
            junction_passed=False,
        )

    def versions(self) -> Mapping[str, str]:
        """Return only its own version: nothing else decides the numbers."""
        return {self.name: self.version}

    def close(self) -> None:
        """Do nothing: there is nothing to free."""

    def _state(self) -> WorldState:
        return WorldState(self._tick, self._ego, self._actors, np.zeros(0, dtype=np.int64))

    def _draw(self, camera: CameraSpec) -> None:
        pixels = self._buffers[camera.name]
        pixels[..., 0] = int(self._ego.x_m * 4.0) % 256
        pixels[..., 1] = min(int(abs(self._actors[0, WorldState.X] - self._ego.x_m) * 4.0), 255)
        pixels[..., 2] = np.arange(camera.height_px, dtype=np.int64)[:, None] % 256
        self._captured[camera.name] = self._tick

    def _maybe_raise(self, method: str) -> None:
        if self.raises is not None and method == self.raises_in and self._tick >= self.raises_at:
            raise self.raises


def _lane_map(x_m: NDArray[np.float64]) -> LaneMap:
    zeros = np.zeros_like(x_m)
    lane = Lane(
        index=0,
        kind=LaneKind.DRIVING,
        centre=np.column_stack([x_m, zeros, zeros]),
        width_m=2.0 * _ROAD_HALF_WIDTH_M,
        speed_limit_mps=_SPEED_LIMIT_MPS,
        junction=False,
        left=-1,
        right=-1,
        left_same_way=False,
        right_same_way=False,
        left_line="solid",
        right_line="solid",
        successors=(),
    )
    return LaneMap("Straight", (lane,), (), np.zeros((0, 4, 2)), np.zeros((0, 6)))
