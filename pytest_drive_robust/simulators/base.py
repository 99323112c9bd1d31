"""What the runner needs of a world: one small Protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.outcome import End, Infraction
from pytest_drive_robust.domain.route import GlobalPlan, Route

if TYPE_CHECKING:
    from pytest_drive_robust.domain.truth import GroundTruth, WorldState


@dataclass(frozen=True, slots=True)
class SimulatorOptions:
    """What a user may choose about any world.

    `tick_cap`: an episode ends after so many ticks (Bench2Drive: 4000). `stuck_stop_s`: end an episode early when
    the ego stood for so many seconds, whatever the scenario says (None: never); the result names it.
    """

    tick_cap: int = 4000
    stuck_stop_s: float | None = None


@dataclass(frozen=True, slots=True)
class EpisodeScore:
    """The criteria's results for one episode; read once, at the end of the episode."""

    end: End
    end_detail: str
    route_completion_pct: float
    route_length_m: float
    infractions: tuple[Infraction, ...]
    speed_ratios_pct: tuple[float, ...]
    junction_passed: bool


class Simulator(Protocol):
    """One world that drives one episode at a time, without globals, seeded by (route, seed).

    The order of calls is `reset`, then for each tick `observe` (at most once) and `step`, until `done` is not None.
    Constructing a simulator is cheap: `reset` builds the world. The arrays of a `WorldState` belong to the caller:
    neither a later call nor anybody else writes to them.

    An optional `check_route(route)` is called at collection, before any episode is driven. `check_route` raises
    `RouteError` for a route that this world cannot drive.

    A world that cannot drive our routes has an optional `routes(names)`. `routes` returns the world's own routes of
    these names; without names, the routes to drive when `--drive-routes` is not given. `routes` raises
    `UnknownNameError`.

    Stored episodes are driven again when the code of the world's own package changes. An optional `sources` names
    other modules whose code counts, and an optional `files` names files whose content counts. `versions` and `version`
    are read before the first `reset`. An optional `portable_bits`, True, promises episodes that are equal to the last
    bit on every machine, with every version of Python and of the libraries that `versions` does not name.
    """

    @property
    def name(self) -> str:
        """Name of the simulator in messages and results."""

    @property
    def version(self) -> str:
        """Version of the world itself; a different version drives every episode again."""

    @property
    def dt_s(self) -> float:
        """Length of a tick in seconds, above 0."""

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        """Build the world of `route` and put the ego at its start. Raises `RouteError`, `SimulationError`."""

    def plan(self) -> GlobalPlan:
        """Return the sparse plan of the current route, which the agent's `reset` receives."""

    def observe(self) -> Observation:
        """Return the clean sensors of this moment, `truth` left out; a later tick may reuse the pixels."""

    def truth(self) -> GroundTruth:
        """Return the state of the world of this moment, for scoring, drawing and privileged agents."""

    def step(self, control: Control) -> WorldState:
        """Advance by one tick. Raises `SimulationError`."""

    @property
    def done(self) -> End | None:
        """Why the episode is over, or None while it is not."""

    @property
    def progress_m(self) -> float:
        """Metres of the route that are behind the ego."""

    def score(self) -> EpisodeScore:
        """Close the criteria (percentages, yield, route completion) and report them."""

    def versions(self) -> Mapping[str, str]:
        """Return the backend, its version, and the versions of the libraries that could change a bit of a result."""

    def close(self) -> None:
        """Free the world's resources. A second call does nothing."""
