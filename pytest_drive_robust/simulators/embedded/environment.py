"""The embedded world as a gymnasium environment; `simulators.gymnasium_ids` registers it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from numpy.typing import NDArray

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded.bev import draw_bev
from pytest_drive_robust.simulators.embedded.geometry import seen_from
from pytest_drive_robust.simulators.embedded.route_sets import DEFAULT_SET
from pytest_drive_robust.simulators.embedded.simulator import EmbeddedSimulator, EpisodeSnapshot
from pytest_drive_robust.simulators.embedded.state import DT_S
from pytest_drive_robust.simulators.routes import resolve_routes

Observed = dict[str, NDArray[Any]]
_TARGET_AHEAD_M = 5.0
_INFRACTION_COST = 10.0
_SIGNALS: Mapping[str, tuple[tuple[int, ...], float]] = {
    "speed": ((1,), 100.0),
    "imu": ((3,), 1000.0),
    "target": ((2, 2), 1e5),
}
"""Shape and largest absolute value of each observation other than the images."""


class WorldSnapshot(NamedTuple):
    """A saved moment of an episode of `WorldEnv`; opaque, made for `WorldEnv.restore`."""

    simulator: EpisodeSnapshot
    next_point: int
    seen: tuple[float, int]


class WorldEnv(gymnasium.Env[Any, NDArray[np.float32]]):
    """One route per episode, 20 Hz.

    * action: Box (3,): throttle 0..1, steer -1..1 (right), brake 0..1
    * observation: Dict of `speed` (1,) m/s, `imu` (3,) forward and right acceleration m/s2 and yaw rate rad/s, `target`
      (2, 2) the next two plan points in metres forward and right of the ego, and one (height, width, 3) uint8 image for
      each camera
    * reward: metres of route gained in this tick, minus 10 for each infraction event
    * terminated: the route ended (completed, off the route, blocked); truncated: the tick cap
    * info: `route` its id, `progress_m`, `infractions` how many so far, `end` how it ended or None, `is_success`
      whether the end was reached without an infraction, metres outside the lanes included

    Each `reset` draws a route and a seed for its actors from the environment's own generator, so `reset(seed=...)`
    repeats an episode and the episodes after it. `reset(options={"route": "101"})` picks the route. `routes` is a
    specification as for `--drive-routes` (`"full"`, `"mine.xml"`, `"101,2301"`), or the routes themselves.

    `snapshot` and `restore` branch an episode: try several actions from the same moment, or search ahead::

        here = env.snapshot()
        for action in candidates:
            env.restore(here)
            env.step(action)
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 -- gymnasium declares it so

    def __init__(
        self,
        routes: str | Sequence[Route] = DEFAULT_SET,
        *,
        cameras: Sequence[CameraSpec] = (),
        options: SimulatorOptions | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.render_mode = render_mode
        self._routes = resolve_routes(routes) if isinstance(routes, str) else tuple(routes)
        if not self._routes:
            raise UsageError("the environment has no routes: give at least one")
        self._cameras = _checked(cameras)
        self._simulator = EmbeddedSimulator(options)
        self._plan = GlobalPlan(())
        self._next = 0
        self._seen = (0.0, 0)
        self._limits = spaces.Box(np.array([0, -1, 0], np.float32), np.ones(3, np.float32))
        self.action_space = self._limits
        self.observation_space = spaces.Dict(
            {name: spaces.Box(-limit, limit, shape, np.float32) for name, (shape, limit) in _SIGNALS.items()}
            | {
                camera.name: spaces.Box(0, 255, (camera.height_px, camera.width_px, 3), np.uint8)
                for camera in self._cameras
            }
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Start a route. Raises `UnknownNameError` for a route that is not the environment's and for other options."""
        super().reset(seed=seed)
        route = self._chosen(options or {})
        self._route_id = route.id
        self._simulator.reset(route, seed=int(self.np_random.integers(2**31)), cameras=self._cameras)
        self._plan = self._simulator.plan()
        self._next = 0
        self._seen = (0.0, 0)
        return self._observed(self._simulator.observe()), self._info(None)

    def step(self, action: NDArray[np.float32]) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Advance by 50 ms; the action is clipped to the action space.

        Raises `gymnasium.error.InvalidAction` unless the action is three finite numbers.
        """
        if not _three_finite(action):
            raise InvalidAction(f"the action is {action!r}, expected three finite numbers: throttle, steer, brake")
        throttle, steer, brake = (float(v) for v in np.clip(action, self._limits.low, self._limits.high))
        self._simulator.step(Control(throttle, steer, brake))
        end = self._simulator.done
        reward = self._reward()
        truncated = end is End.TICK_CAP
        info = self._info(end)
        return self._observed(self._simulator.observe()), reward, end is not None and not truncated, truncated, info

    def snapshot(self) -> WorldSnapshot:
        """Copy this moment: a few kilobytes of arrays, and the images of cameras slower than 20 Hz."""
        return WorldSnapshot(self._simulator.snapshot(), self._next, self._seen)

    def restore(self, snapshot: WorldSnapshot) -> None:
        """Restore a moment of this episode, to the bit. Raises `SimulationError` for one before the last `reset`."""
        self._simulator.restore(snapshot.simulator)
        self._next, self._seen = snapshot.next_point, snapshot.seen

    def render(self) -> NDArray[np.uint8]:
        """Return a bird's-eye view, (512, 512, 3) uint8 RGB."""
        world = self._simulator.world
        return draw_bev(world.lane_map, self._simulator.state, world.dense.rows).pixels

    def close(self) -> None:
        """Free the world."""
        self._simulator.close()

    def _chosen(self, options: Mapping[str, Any]) -> Route:
        unknown = sorted(options.keys() - {"route"})
        if unknown:
            raise UnknownNameError.of("reset option", unknown[0], ["route"])
        if "route" not in options:
            return self._routes[int(self.np_random.integers(len(self._routes)))]
        by_id = {route.id: route for route in self._routes}
        wanted = str(options["route"])
        if wanted not in by_id:
            raise UnknownNameError.of("route of this environment", wanted, by_id)
        return by_id[wanted]

    def _reward(self) -> float:
        infractions, progress_m = self._simulator.world.state.infractions(), self._simulator.progress_m
        gained = progress_m - self._seen[0] - _INFRACTION_COST * (infractions - self._seen[1])
        self._seen = (progress_m, infractions)
        return float(gained)

    def _info(self, end: End | None) -> dict[str, Any]:
        infractions = self._simulator.world.state.infractions()
        return {
            "route": self._route_id,
            "progress_m": self._simulator.progress_m,
            "infractions": infractions,
            "end": None if end is None else end.value,
            "is_success": end is End.COMPLETED and not self._simulator.score().infractions,
        }

    def _observed(self, observation: Observation) -> Observed:
        points = self._plan.points
        while self._next < len(points) - 2 and self._local(observation, self._next)[0] < _TARGET_AHEAD_M:
            self._next += 1
        target = [self._local(observation, min(self._next + k, len(points) - 1)) for k in range(2)]
        imu = observation.imu
        seen: Observed = {
            "speed": np.array([observation.speed.mps], np.float32),
            "imu": np.array([imu.forward_mps2, imu.right_mps2, imu.yaw_rate_radps], np.float32),
            "target": np.array(target, np.float32),
        }
        return seen | {name: image.pixels.copy() for name, image in observation.cameras.items()}

    def _local(self, observation: Observation, index: int) -> tuple[float, float]:
        point, gps = self._plan.points[index], observation.gps
        return seen_from((gps.x_m, gps.y_m, observation.compass.yaw_rad), (point.x_m, point.y_m))


def _checked(cameras: Sequence[CameraSpec]) -> tuple[CameraSpec, ...]:
    """Return the cameras. Raises `UsageError` for an impossible camera and for a name that is already taken."""
    taken = set(_SIGNALS)
    for camera in cameras:
        problem = camera.problem(DT_S)
        if problem is not None:
            raise UsageError(f"camera {camera.name!r}: {problem}")
        if camera.name in taken:
            raise UsageError(
                f"camera {camera.name!r}: another camera or a signal has this name, expected one of its own"
            )
        taken.add(camera.name)
    return tuple(cameras)


def _three_finite(action: object) -> bool:
    try:
        return np.shape(action) == (3,) and bool(np.isfinite(action).all())  # type: ignore[call-overload]
    except (TypeError, ValueError):  # text, None, a list within a list
        return False
