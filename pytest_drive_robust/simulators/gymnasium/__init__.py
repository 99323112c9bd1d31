"""`gymnasium:ID`: highway-env's environments, and similar environments, behind our `Simulator` protocol.

Modules: `environments` decides which environments can be driven and makes one at 20 Hz; `class_attributes` keeps what
an environment writes to shared classes away from the others; `routes` numbers the resets. `road_map` reads the lanes,
`itinerary` finds the lanes to the ego's destination, `route_line` draws the route along them. `ego` is the vehicle that
the agent drives, `live_road` steps the environment and reads its vehicles, `criteria` judges. Other packages import
`simulator`.
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
