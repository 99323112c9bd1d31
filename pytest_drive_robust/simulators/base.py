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
    """What the criteria say about the episode so far; read once, at its end."""

    end: End
    end_detail: str
    route_completion_pct: float
    route_length_m: float
    infractions: tuple[Infraction, ...]
    speed_ratios_pct: tuple[float, ...]
    junction_passed: bool


class Simulator(Protocol):
    """One world, one episode at a time. No globals; everything seeded by (route, seed).

    The order of calls is `reset`, then for each tick `observe` (at most once) and `step`, until `done` is not None.
    Making one is cheap: the world is built by `reset`. The arrays of a `WorldState` belong to whoever was given it: no
    later call writes to them, and nobody else does.

    An optional `check_route(route)` is called at collection, before anything is driven, and raises `RouteError` for a
    route that cannot be driven here.

    A world that cannot drive our routes has an optional `routes(names)`: its own routes of those names, or without
    names those that are driven when `--drive-routes` is not given. It raises `UnknownNameError`.

    Stored episodes are driven again when the code of the world's own package changes; an optional `sources` names
    modules elsewhere whose code counts, too, and an optional `files` the files whose content does. `versions` and
    `version` are asked for before the first `reset`. An optional `portable_bits`, True, promises the same
    episode to the last bit on every machine, with every version of Python and of the libraries that `versions` does not
    tell.
    """

    @property
    def name(self) -> str:
        """What people call it: messages and results name it so."""

    @property
    def version(self) -> str:
        """Of the world itself: another one drives every episode again."""

    @property
    def dt_s(self) -> float:
        """Seconds of a tick, above 0."""

    def reset(self, route: Route, *, seed: int, cameras: Sequence[CameraSpec]) -> WorldState:
        """Build the world of `route` and put the ego at its start. Raises `RouteError`, `SimulationError`."""

    def plan(self) -> GlobalPlan:
        """Return the sparse plan of the current route: what the agent's `reset` gets."""

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
        """Return what decides the numbers: backend, its version, versions of libraries that could change a bit."""

    def close(self) -> None:
        """Free what the world holds. Calling it twice does no harm."""
