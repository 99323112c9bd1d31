"""The default backend: `World`, its sensors and its criteria behind the `Simulator` protocol.

The first `reset` or `check_route` imports the world. A run whose episodes are all stored reads only the simulator's
name, tick and versions, and need not wait for numba.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Image, Observation
from pytest_drive_robust.domain.outcome import End
from pytest_drive_robust.domain.route import GlobalPlan, Route
from pytest_drive_robust.domain.truth import GroundTruth, WorldState
from pytest_drive_robust.errors import SimulationError
from pytest_drive_robust.jit.kernels import require_compiling
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.route_sets import is_shipped
from pytest_drive_robust.simulators.embedded.scoring import ENDS, score_of
from pytest_drive_robust.simulators.embedded.sensors import Sensors
from pytest_drive_robust.simulators.embedded.state import DT_S, State

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.embedded.world import World


class EpisodeSnapshot(NamedTuple):
    """A saved moment of an episode: its world, the changing arrays, and the last images of slow cameras."""

    world: World
    state: State
    images: Mapping[str, Image]


class EmbeddedSimulator:
    """A 20 Hz world in arrays.

    >>> simulator = EmbeddedSimulator()
    >>> simulator.name, simulator.dt_s
    ('embedded', 0.05)
    """

    name = "embedded"
    version = "5"
    dt_s = DT_S
    portable_bits = True

    def __init__(self, options: SimulatorOptions | None = None) -> None:
        self.options = options or SimulatorOptions()
        self._episode: tuple[World, Sensors] | None = None
        self._state: WorldState | None = None

    @property
    def world(self) -> World:
        """The world of the current episode. Raises `SimulationError` before the first `reset`."""
        return self._now[0]

    @property
    def sensors(self) -> Sensors:
        """The sensors of the current episode. Raises `SimulationError` before the first `reset`."""
        return self._now[1]

    @property
    def _now(self) -> tuple[World, Sensors]:
        if self._episode is None:
            raise SimulationError("the embedded simulator has no route yet: call reset(route, seed=..., cameras=...)")
        return self._episode

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        """Build the world of `route` and put the ego at its start. Raises `RouteError`, `SimulationError`."""
        world = self._build(route, seed)
        sensors = Sensors(cameras, lane_map=world.lane_map, weather=route.weather, route=world.dense.rows, dt_s=DT_S)
        self._episode = world, sensors
        self._state = world.now()
        return self._state

    def check_route(self, route: Route) -> None:
        """Build the route once; raise `UsageError` when its town, way or scenario cannot be built.

        Routes that we ship are known to build and are not tried, so that a process that only judges stored episodes
        loads no world. Raises `UsageError` for every route where numba may not compile.
        """
        require_compiling()
        if not is_shipped(route):
            self._build(route, 0)

    def _build(self, route: Route, seed: int) -> World:
        from pytest_drive_robust.simulators.embedded.world import World  # loads numba

        return World(route, seed=seed, options=self.options)

    def plan(self) -> GlobalPlan:
        """Return the sparse plan of the current route."""
        return self.world.dense.plan()

    def observe(self) -> Observation:
        """Return the clean sensors of this moment."""
        return self.sensors.observe(self.state)

    @property
    def state(self) -> WorldState:
        """The dynamic world of this moment."""
        if self._state is None:
            self._state = self.world.now()
        return self._state

    def truth(self) -> GroundTruth:
        """Return the state of the world of this moment."""
        return self.world.truth(self.state)

    def step(self, control: Control) -> WorldState:
        """Advance by 50 ms."""
        self.world.tick(control)
        self._state = self.world.now()
        return self._state

    @property
    def done(self) -> End | None:
        """Why the episode is over, or None while it is not."""
        return ENDS.get(int(self.world.state.criteria_ints[c.CI_END]))

    @property
    def progress_m(self) -> float:
        """Metres of the route that are behind the ego."""
        world = self.world
        return float(world.dense.s[world.state.criteria_ints[c.CI_PROGRESS]])

    def score(self) -> EpisodeScore:
        """Close the criteria and report them; once per episode."""
        self.world.close_criteria()
        return score_of(self.world, self.options)

    def snapshot(self) -> EpisodeSnapshot:
        """Return a copy of all changing arrays; takes microseconds without slow cameras."""
        world = self.world
        return EpisodeSnapshot(world, world.snapshot(), self.sensors.snapshot())

    def restore(self, snapshot: EpisodeSnapshot) -> None:
        """Restore a snapshot of this episode, any number of times. Raises `SimulationError` for another episode's."""
        if snapshot.world is not self.world:
            raise SimulationError("a snapshot is of another episode, expected one taken since the last reset")
        self.world.restore(snapshot.state)
        self.sensors.restore(snapshot.images)
        self._state = None

    def place_ego(self, *, x_m: float, y_m: float, yaw_rad: float, speed_mps: float) -> WorldState:
        """Put the ego elsewhere at this moment of the episode, for data and experiments that branch from it.

        The wheels keep their angle; with a speed of 0 the ego is at rest. The IMU is updated. No actor moves and no
        criterion is judged before the next `step`. Raises `SimulationError` for numbers that are not finite and for a
        negative speed.
        """
        self.world.place_ego(x_m, y_m, yaw_rad, speed_mps)
        self._state = None
        return self.state

    def versions(self) -> Mapping[str, str]:
        """Return the world's own version; no version of a library changes a bit of an episode."""
        return {"simulator": f"{self.name} {self.version}"}

    def close(self) -> None:
        """Forget the current world."""
        self._episode = self._state = None
