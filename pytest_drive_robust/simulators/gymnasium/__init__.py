"""`gymnasium:ID`: highway-env's environments, and similar environments, behind our `Simulator` protocol.

Modules: `environments` decides which environments can be driven, makes an environment at 20 Hz and isolates its class
attributes; `route_line` reads the ego's destination and draws the route there, `road_map` reads the lanes; `live_road`
applies controls and reads the vehicles; `criteria` judges; other packages import `simulator`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.base import SimulatorOptions
    from pytest_drive_robust.simulators.gymnasium.simulator import GymnasiumSimulator

__all__ = ["gymnasium_simulator"]


def gymnasium_simulator(options: SimulatorOptions, identifier: str = "") -> GymnasiumSimulator:
    """Return the world of `--drive-sim gymnasium:IDENTIFIER`. Raises `UsageError` for an id that cannot be driven."""
    if not identifier:
        raise UsageError("the simulator 'gymnasium' needs an environment: give gymnasium:ID, as in gymnasium:merge-v0.")
    from pytest_drive_robust.simulators.gymnasium.simulator import GymnasiumSimulator

    return GymnasiumSimulator(identifier, options)
