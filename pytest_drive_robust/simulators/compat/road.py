"""`CompatRoad`: a live highway-env `Road`, stepped by our kernels with highway-env's exact semantics."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.errors import SimulationError, nearest
from pytest_drive_robust.simulators.compat import columns as c
from pytest_drive_robust.simulators.compat.advance import advance
from pytest_drive_robust.simulators.compat.arithmetic import is_exact
from pytest_drive_robust.simulators.compat.known import check_road
from pytest_drive_robust.simulators.compat.network import LaneIndex, Network
from pytest_drive_robust.simulators.compat.reading import Reading
from pytest_drive_robust.simulators.compat.told import tell

__all__ = ["CompatRoad"]

Saved = tuple[NDArray[Any], ...]

_TOLD = {
    "IDLE": c.TOLD_IDLE,
    "FASTER": c.TOLD_FASTER,
    "SLOWER": c.TOLD_SLOWER,
    "LANE_LEFT": c.TOLD_LEFT,
    "LANE_RIGHT": c.TOLD_RIGHT,
}


class CompatRoad:
    """What `Road.act()` and `Road.step(dt)` of highway-env 1.12 do, on arrays that were read from a live road.

    The live road stands still until `write_back()`. Left out: the yielding rule of `RegulatedRoad`, the regression
    data that a `LinearVehicle` collects, and warnings about routes that do not fit. No step draws a random number.
    """

    semantics = "highway-env 1.12"

    def __init__(self, road: Any, network: Network, *, ego: Any) -> None:
        self._road = road
        self._network = network
        self._ego = ego
        self.read_back()

    @classmethod
    def from_road(cls, road: Any, *, ego: Any = None, ignore_road_rules: bool = False) -> CompatRoad:
        """Read a live `highway_env.road.road.Road`; `ego` is the vehicle that `step` may tell what to do.

        Raises `SimulationError` for roads, lanes, vehicles and objects of classes that the kernels do not know, and
        for a `RegulatedRoad` unless `ignore_road_rules`.
        """
        check_road(road, ignore_road_rules=ignore_road_rules)
        connected = bool(getattr(road, "neighbour_vehicles_connected_lanes", False))
        return cls(road, Network.from_road_network(road.network, connected=connected), ego=ego)

    @property
    def exact(self) -> bool:
        """Whether this machine's arithmetic is matched to the bit; otherwise results agree to about 1e-9."""
        return is_exact()

    @property
    def ego(self) -> int | None:
        """The row of the ego, or None when `from_road` got none."""
        return None if self._ego is None else self._ego_row

    @property
    def positions_m(self) -> NDArray[np.float64]:
        """(n, 2) copy: vehicles in the order of the road, then objects."""
        return self._column(slice(c.B_X, c.B_Y + 1))

    @property
    def headings_rad(self) -> NDArray[np.float64]:
        """(n,) copy, not normalised."""
        return self._column(c.B_HEADING)

    @property
    def speeds_mps(self) -> NDArray[np.float64]:
        """(n,) copy; negative in reverse."""
        return self._column(c.B_SPEED)

    @property
    def crashed(self) -> NDArray[np.bool_]:
        """(n,) copy."""
        return self._arrays.body_ints[:, c.I_CRASHED].astype(np.bool_)

    @property
    def lane_indices(self) -> list[LaneIndex]:
        """The closest lane of each body as (from, to, id)."""
        return [self._network.indices[k] for k in self._arrays.body_ints[:, c.I_LANE]]

    def step(self, dt_s: float, ego_action: tuple[float, float] | str | None = None) -> None:
        """`ego.act(ego_action)` unless None, then `road.act()`, then `road.step(dt_s)`.

        `ego_action` is (acceleration [m/s2], steering [rad]) for a plain `Vehicle`, and "IDLE", "FASTER", "SLOWER",
        "LANE_LEFT" or "LANE_RIGHT" for a `ControlledVehicle` or `MDPVehicle`; others drive themselves. Raises
        `SimulationError` for an action that the ego does not understand.
        """
        if ego_action is not None:
            self._tell(ego_action)
        advance(self._arrays, self._reading.vehicle_count, dt_s)

    def read_back(self) -> None:
        """Read all vehicles and objects again, after somebody changed, added or removed some on the live road."""
        rows = [row for row, vehicle in enumerate(self._road.vehicles) if vehicle is self._ego]
        if self._ego is not None and not rows:
            raise SimulationError("The ego is not among the road's vehicles: pass one of road.vehicles as ego.")
        self._ego_row = rows[0] if rows else -1
        self._reading = Reading.of_road(self._road, self._network)
        self._arrays = self._reading.arrays

    def write_back(self) -> None:
        """Write the arrays into the live vehicles and objects, for rendering, observations and rewards.

        A road that records histories gets one entry per call.
        """
        self._reading.write(self._network, keep_history=bool(self._road.record_history))

    def snapshot(self) -> Saved:
        """The state as copies of arrays, for `restore`; valid until the next `read_back`."""
        return tuple(array.copy() for array in self._state())

    def restore(self, saved: Saved) -> None:
        """Go back to a `snapshot` of this road."""
        for array, before in zip(self._state(), saved, strict=True):
            array[...] = before

    def _column(self, which: int | slice) -> NDArray[np.float64]:
        return np.array(self._arrays.bodies[:, which])

    def _state(self) -> Saved:
        arrays = self._arrays
        return arrays.bodies, arrays.body_ints, arrays.routes, arrays.coordinates

    def _tell(self, action: tuple[float, float] | str) -> None:
        if self._ego_row < 0:
            raise SimulationError("Nobody can be told anything: CompatRoad.from_road got no ego.")
        kind = self._arrays.body_ints[self._ego_row, c.I_KIND]
        if kind == c.PLAIN and not isinstance(action, str):
            self._arrays.bodies[self._ego_row, [c.B_ACCELERATION, c.B_STEERING]] = action
        elif kind in (c.CONTROLLED, c.MDP) and isinstance(action, str) and action in _TOLD:
            speeds = np.array(getattr(self._ego, "target_speeds", ()), dtype=np.float64)
            tell(self._arrays, self._ego_row, _TOLD[action], speeds)
        else:
            raise SimulationError(_not_understood(type(self._ego).__name__, kind, action))


def _not_understood(name: str, kind: int, action: object) -> str:
    if kind >= c.IDM:
        return f"The ego, a {name}, drives itself and cannot be told {action!r}: give None."
    expected = "(acceleration_mps2, steering_rad)" if kind == c.PLAIN else f"one of {', '.join(sorted(_TOLD))}"
    near = nearest(action, _TOLD) if isinstance(action, str) and kind != c.PLAIN else None
    hint = f" Did you mean {near!r}?" if near else ""
    return f"The ego, a {name}, cannot be told {action!r}: give {expected}.{hint}"
