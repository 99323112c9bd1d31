"""The facts that one episode produced; `metrics` computes scores from these facts."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Infraction, Outcome
from pytest_drive_robust.errors import UnknownNameError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Ints = NDArray[np.int32]

_Table = TypeVar("_Table", bound="NDArray[np.generic]")
MACHINE_FACTS = {
    "machine libm": "C library",
    "machine numpy": "numpy",
    "machine torch": "torch",
    "machine onnxruntime": "ONNX Runtime",
}
"""Entries of `EpisodeResult.versions` that tell what a machine computes (`runner.episode.machine`), each with the
library that computes it. No key has these entries. An episode has only the entries that its bits depend on."""
CONTROL = "control"
"""The name of the command on its way from the agent to the vehicle, beside `SIGNALS` and the names of cameras."""


def read_only(table: _Table) -> _Table:
    """Make an array read-only and return it: metrics get the run's own arrays, not copies."""
    table.flags.writeable = False
    return table


@dataclass(frozen=True, slots=True)
class Trace:
    """The ego at the end of each tick: `rows` is (ticks, 11) float64, columns in the order of `COLUMNS`.

    x, y in metres; yaw in radians; speed in m/s; forward and right acceleration in m/s2 (vehicle frame); yaw rate in
    rad/s; the control that the vehicle got; route progress in metres.
    """

    rows: NDArray[np.float64]

    COLUMNS = (
        "x_m",
        "y_m",
        "yaw_rad",
        "speed_mps",
        "forward_mps2",
        "right_mps2",
        "yaw_rate_radps",
        "throttle",
        "steer",
        "brake",
        "progress_m",
    )

    def column(self, name: str) -> NDArray[np.float64]:
        """Return one column of `rows` by its name. Raises `UnknownNameError` for one that is not in `COLUMNS`."""
        if name not in self.COLUMNS:
            raise UnknownNameError.of("column of a trace", name, self.COLUMNS)
        values: NDArray[np.float64] = self.rows[:, self.COLUMNS.index(name)]
        return values

    def columns(self, *names: str) -> tuple[NDArray[np.float64], ...]:
        """Return several columns. A stored trace unpacks only these columns and does not keep them in memory."""
        return tuple(self.column(name) for name in names)

    def problem(self) -> str | None:
        """Return the first value that is not finite (`"speed_mps is nan after 31 ticks, expected ..."`), or None."""
        import numpy as np

        wrong = np.argwhere(~np.isfinite(self.rows))
        if not len(wrong):
            return None
        tick, column = wrong[0]
        return f"{self.COLUMNS[column]} is {self.rows[tick, column]:g} after {tick + 1} ticks, expected a finite number"

    @property
    def digest(self) -> str:
        """Hex digest of the bytes: equal digests mean bit-identical trajectories."""
        return hashlib.blake2b(self.rows.tobytes(), digest_size=16).hexdigest()


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """The observations that the agent got, one row each: `rows` is (observations, 5 + cameras) float32.

    The first columns are `COLUMNS`: the tick, GPS in metres, the compass in radians clockwise from north, the speed in
    m/s, all as perturbed. Then, for each camera of `Reception.cameras`, the tick at which its image was captured (NaN
    without an image).
    """

    rows: NDArray[np.float32]

    COLUMNS = ("tick", "gps_x_m", "gps_y_m", "heading_rad", "speed_mps")

    def column(self, name: str) -> NDArray[np.float32]:
        """Return one of the first columns by its name."""
        values: NDArray[np.float32] = self.rows[:, self.COLUMNS.index(name)]
        return values


@dataclass(frozen=True, slots=True)
class Injection:
    """One stretch of the injected schedule: `perturbation` touched `signal` in ticks `first_tick..last_tick`."""

    perturbation: str
    signal: str
    first_tick: int
    last_tick: int


@dataclass(frozen=True, slots=True)
class EpisodeResult:
    """The record of one finished episode.

    `route_completion_pct` is 0..100; `speed_ratios_pct` are the ego's mean speed in percent of the traffic's, one per
    twentieth of the route (empty when the ego never got that far). `end_detail` says in one sentence why the episode
    ended; for `agent_error` it holds the traceback's last line. `inference_s` are the wall times of `act`, one per
    call, kept only when the setting's latency is measured. `reception` tells which signals the setting changed, `given`
    holds what the agent got, tick by tick, `tracks` what was around the ego; each is None when it was not recorded.
    """

    episode: Episode
    scenario: str
    outcome: Outcome
    end: End
    end_detail: str
    route_completion_pct: float
    route_length_m: float
    infractions: tuple[Infraction, ...]
    speed_ratios_pct: tuple[float, ...]
    ticks: int
    dt_s: float
    wall_s: float
    trace: Trace
    schedule: tuple[Injection, ...] = ()
    inference_s: tuple[float, ...] = ()
    privileged: bool = False
    junction_passed: bool = False
    versions: Mapping[str, str] = field(default_factory=dict)
    reception: Reception | None = None
    given: Given | None = field(default=None, compare=False)  # `==` of arrays gives no single bool
    tracks: Tracks | None = field(default=None, compare=False)

    @property
    def game_s(self) -> float:
        """Simulated seconds."""
        return self.ticks * self.dt_s


def merged_versions(several: Iterable[Mapping[str, str]]) -> dict[str, str]:
    """Return the versions of several episodes as one mapping; several values of one name are all shown, sorted."""
    found: dict[str, set[str]] = {}
    for versions in several:
        for name, version in versions.items():
            found.setdefault(name, set()).add(version)
    return {name: ", ".join(sorted(values)) for name, values in found.items()}


@dataclass(frozen=True, slots=True)
class Touch:
    """One signal that a setting changed: in how many ticks, and in which one first.

    `signal` is the name of a camera, `"gps"`, `"compass"`, `"imu"`, `"speed"`, or `"control"` when the vehicle got
    another command than the agent gave in that tick, or when the agent's computer was too busy to be asked.
    """

    signal: str
    ticks: int
    first_tick: int


@dataclass(frozen=True, slots=True)
class Reception:
    """Proof of what a setting did at the two seams of one episode.

    `cameras` are the names of the agent's rig, `consumes` the signals that reach the policy as the agent declares
    (default: all), `observations` the number of observations that the agent got. `touched` is empty when the setting
    changed nothing.
    """

    cameras: tuple[str, ...]
    consumes: tuple[str, ...]
    observations: int
    touched: tuple[Touch, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Actors and lights near the ego at the beginning of every `every_ticks`-th tick, and some of the agent's plans.

    All tables are int32. Sample `k` is the world at the beginning of tick `k * every_ticks`.

    `actors` is (n, 6), one row for each stretch of time in which an actor was there: id, `ActorKind`, length and width
    in cm, first sample, number of samples. `motion` is (sum of samples, 4), all samples of the first actor, then of the
    second, and so on: x and y in cm, yaw in mrad (not wrapped), `ActorState`. `lights` is (samples, stop lines):
    `LightState`.

    `plans` is (m, 4): the tick of the plan, then the number of its path, target and speed points. `points` is
    (sum of these numbers, 2): forward and right of the ego of that tick in dm, the points of one plan after the other.
    """

    every_ticks: int
    actors: Ints
    motion: Ints
    lights: Ints
    plans: Ints
    points: Ints
