"""`--drive-sim gymnasium:ID`: a gymnasium driving environment as it is, behind the `Simulator` protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.domain.truth import GroundTruth, LaneMap, WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions
from pytest_drive_robust.simulators.embedded.sensors import Sensors
from pytest_drive_robust.simulators.gymnasium import environments
from pytest_drive_robust.simulators.gymnasium.class_attributes import ClassAttributes
from pytest_drive_robust.simulators.gymnasium.criteria import EpisodeCriteria
from pytest_drive_robust.simulators.gymnasium.itinerary import itinerary_of
from pytest_drive_robust.simulators.gymnasium.live_road import LiveRoad
from pytest_drive_robust.simulators.gymnasium.road_map import junction_keys, read_map
from pytest_drive_robust.simulators.gymnasium.route_line import RouteLine, draw_line
from pytest_drive_robust.simulators.gymnasium.routes import reset_seed, routes_of


@dataclass
class _Episode:
    """The state of one episode: of one route and seed."""

    road: LiveRoad
    line: RouteLine
    lane_map: LaneMap
    criteria: EpisodeCriteria
    sensors: Sensors
    state: WorldState


class GymnasiumSimulator:
    """One environment, driven at 20 Hz with our sensors and criteria.

    Route `ID-NUMBER` is the environment reset with the seed `NUMBER + 100000 * the episode's seed`. The ego's way is
    planned by the environment, or goes straight on (`itinerary_of`). The environment's `duration` is lifted; its other
    ends (a crash, leaving the road) end the episode. Raises `UnknownNameError` for an unregistered id and `UsageError`
    for an environment that we cannot drive; both messages list the drivable environments.
    """

    version = "2"
    dt_s = 1.0 / environments.RATE_HZ

    def __init__(self, identifier: str, options: SimulatorOptions | None = None) -> None:
        self.options = options or SimulatorOptions()
        self._spec = environments.find_spec(identifier)
        self.name = f"gymnasium:{identifier}"
        self._registered_by = identifier.rpartition(":")[0]
        self._classes = ClassAttributes()
        self._env: environments.Environment | None = None
        self._episode: _Episode | None = None
        if self._spec.id not in environments.WORKING:  # unknown to us: fail now if it cannot be driven
            with self._classes.inside():
                self._env = environments.make_environment(self._spec, name=self.name)

    @property
    def environment(self) -> environments.Environment:
        """The gymnasium environment of the current episode. Raises `SimulationError` before the first `reset`."""
        if self._env is None:
            raise SimulationError(f"{self.name} has no route yet: call reset(route, seed=..., cameras=...)")
        return self._env

    def routes(self, names: Sequence[str] = ()) -> tuple[Route, ...]:
        """Return the routes of the given names; without names `ID-0` to `ID-9`. Raises `UnknownNameError`."""
        return routes_of(self.name, self._spec.id, names)

    def check_route(self, route: Route) -> None:
        """Raise `RouteError` for a route of another world."""
        self._reset_seed(route, 0)

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        """Reset the environment for `route`. Raises `RouteError`, `SimulationError`, `UsageError`."""
        number = self._reset_seed(route, seed)
        self._episode = None
        self._classes = ClassAttributes()
        with self._classes.inside():
            if self._env is None:
                self._env = environments.make_environment(self._spec, name=self.name)
            self._env.reset(seed=number)
            self._episode = self._begin(self._env, route, cameras)
        return self._episode.state

    def plan(self) -> GlobalPlan:
        """Return the sparse plan of the current route."""
        return self._now.line.plan()

    def observe(self) -> Observation:
        """Return the clean sensors of this moment."""
        episode = self._now
        return episode.sensors.observe(episode.state)

    def truth(self) -> GroundTruth:
        """Return the state of the world of this moment."""
        episode = self._now
        return GroundTruth(episode.state, episode.lane_map, episode.line.rows, episode.criteria.row)

    def step(self, control: Control) -> WorldState:
        """Advance by 50 ms."""
        episode = self._now
        with self._classes.inside():
            episode.road.step(control)
            episode.state = episode.road.state()
            episode.criteria.judge(episode.state)
        return episode.state

    @property
    def done(self) -> End | None:
        """Why the episode is over, or None while it is not."""
        return self._now.criteria.end

    @property
    def progress_m(self) -> float:
        """Metres of the route that are behind the ego."""
        return self._now.criteria.progress_m

    def score(self) -> EpisodeScore:
        """Close the criteria and report them."""
        episode = self._now
        return episode.criteria.score(episode.state)

    @property
    def sources(self) -> tuple[str, ...]:
        """The module of the environment, and the module that registers it with its arguments."""
        maker = self._spec.entry_point
        brings = maker.partition(":")[0] if isinstance(maker, str) else str(maker.__module__)
        return tuple(dict.fromkeys(filter(None, (brings, self._registered_by))))

    def versions(self) -> Mapping[str, str]:
        """Return the versions of the simulator and of the libraries that compute; the sensors are our own world's."""
        import highway_env

        return {
            "simulator": f"{self.name} {self.version}",
            "gymnasium": str(gymnasium.__version__),
            "highway-env": str(getattr(highway_env, "__version__", "unknown")),
            "numpy": str(np.__version__),
        }

    def close(self) -> None:
        """Close the environment. Calling it twice does no harm."""
        self._episode = None
        if self._env is not None:
            self._env.close()
            self._env = None

    def _reset_seed(self, route: Route, seed: int) -> int:
        return reset_seed(route, seed, simulator=self.name, identifier=self._spec.id)

    @property
    def _now(self) -> _Episode:
        if self._episode is None:
            raise SimulationError(f"{self.name} has no route yet: call reset(route, seed=..., cameras=...)")
        return self._episode

    def _begin(self, env: environments.Environment, route: Route, cameras: Sequence[CameraSpec]) -> _Episode:
        inner: Any = env.unwrapped
        network, start = inner.road.network, np.asarray(inner.vehicle.position, dtype=float)
        line = draw_line(network, itinerary_of(inner), start, junction_keys(network))
        lane_map, index = read_map(network, line.rows, name=self.name)
        road = LiveRoad(env, lane_map, index, dt_s=self.dt_s)
        return _Episode(
            road=road,
            line=line,
            lane_map=lane_map,
            criteria=EpisodeCriteria(road, line, lane_map, index, dt_s=self.dt_s, options=self.options),
            sensors=Sensors(cameras, lane_map=lane_map, weather=route.weather, route=line.rows, dt_s=self.dt_s),
            state=road.state(),
        )
