"""How the ego of the embedded world responds, against the fits of CARLA's car: accelerations and yaw rates.

    python benchmarks/vehicle.py

The fits are PDM-Lite's of the Lincoln MKZ 2020 in CARLA 0.9.15 at 20 Hz (SimLingo
`Bench2Drive/leaderboard/team_code/config.py`, `kinematic_bicycle_model.py`; the steering is World on Rails'). A
response is that of one tick. The errors are those over a grid of speeds and controls within the range where the fits
hold: throttle from 0.3 (from 0.5 above 18 m/s), full brakes from 1 m/s, steering below a lateral acceleration of
7 m/s2, all up to 25 m/s.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "helpers"))

from fitted_mkz import BRAKE, FITTED_THROTTLE, fitted_speed, fitted_yaw_rate

from pytest_drive_robust import Control
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes

DT_S = 0.05
SPEEDS = (0.0, 2.0, 5.0, 8.0, 12.0, 18.0, 25.0)
GRID = tuple(0.5 * k for k in range(51))
PEDALS = tuple(Control(throttle=u) for u in (0.0, 0.15, 0.3, 0.5, 0.75, 1.0)) + tuple(
    Control(brake=b) for b in (0.25, 0.5, 1.0)
)
STEERS = (0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


def fitted_acceleration(speed_mps: float, control: Control) -> float | None:
    """Return m/s2, or None where no fit holds."""
    if control.brake == 1.0 and speed_mps >= 1.0:
        return (fitted_speed(speed_mps, 0.0, BRAKE) - speed_mps) / DT_S
    if control.brake > 0.0 or control.throttle < (0.3 if speed_mps <= 18.0 else 0.5):
        return None
    return (max(fitted_speed(speed_mps, control.throttle, FITTED_THROTTLE), 0.0) - speed_mps) / DT_S


class Driven:
    """The ego on a road, without interference by others, to measure its responses."""

    def __init__(self) -> None:
        self._simulator = EmbeddedSimulator(SimulatorOptions(tick_cap=10**9))
        start = self._simulator.reset(named_routes("full")[0], seed=0, cameras=()).ego
        self._start = {"x_m": start.x_m, "y_m": start.y_m, "yaw_rad": start.yaw_rad}
        self._snapshot = self._simulator.snapshot()

    def response(self, speed_mps: float, control: Control) -> tuple[float, float]:
        """Return acceleration and yaw rate in a tick with that control, from that speed."""
        self._simulator.restore(self._snapshot)
        self._simulator.place_ego(**self._start, speed_mps=speed_mps)
        ego = self._simulator.step(control).ego
        return (ego.speed_mps - speed_mps) / DT_S, ego.yaw_rate_radps


def errors(driven: Driven) -> Iterator[tuple[str, float]]:
    """Yield (which response, absolute difference from the fit) over the grid."""
    for v in GRID:
        for k in range(15):
            control = Control(throttle=0.3 + 0.05 * k)
            fitted = fitted_acceleration(v, control)
            if fitted is not None:
                yield "throttle, m/s2", abs(driven.response(v, control)[0] - fitted)
        fitted = fitted_acceleration(v, Control(brake=1.0))
        if fitted is not None:
            yield "full brakes, m/s2", abs(driven.response(v, Control(brake=1.0))[0] - fitted)
        for k in range(-10, 11):
            steer = 0.1 * k
            if v and abs(fitted_yaw_rate(v, steer)) * v <= 7.0:
                found = driven.response(v, Control(throttle=_holding(v), steer=steer))[1]
                yield "yaw rate, rad/s", abs(found - fitted_yaw_rate(v, steer))


def _holding(speed_mps: float) -> float:
    """Return a throttle that does not stop the car within a tick."""
    return 0.5 if speed_mps < 12.0 else 0.6


def _named(control: Control) -> str:
    return f"brake {control.brake:g}" if control.brake else f"throttle {control.throttle:g}"


def main() -> None:
    driven = Driven()
    accelerations = Table("m/s2 at m/s", *(f"{v:g}" for v in SPEEDS), title="ego / fit")
    for control in PEDALS:
        cells = []
        for v in SPEEDS:
            fitted = fitted_acceleration(v, control)
            cells.append(f"{driven.response(v, control)[0]:.2f} / {'-' if fitted is None else f'{fitted:.2f}'}")
        accelerations.add_row(_named(control), *cells)
    turns = Table("rad/s at m/s", *(f"{v:g}" for v in SPEEDS[1:]), title="ego / fit")
    for steer in STEERS:
        cells = []
        for v in SPEEDS[1:]:
            control = Control(throttle=_holding(v), steer=steer)
            cells.append(f"{driven.response(v, control)[1]:.3f} / {fitted_yaw_rate(v, steer):.3f}")
        turns.add_row(f"steer {steer:g}", *cells)
    summary = Table("from the fit", "largest (mean) error where the fits hold")
    found: dict[str, list[float]] = {}
    for what, error in errors(driven):
        found.setdefault(what, []).append(error)
    for what, values in found.items():
        summary.add_row(what, f"{max(values):.3f} ({statistics.fmean(values):.3f})")
    console = Console(width=190)
    for table in (accelerations, turns, summary):
        console.print(table)


if __name__ == "__main__":
    main()
