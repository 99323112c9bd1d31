"""`gymnasium:ID`: highway-env's environments, and any that is built like them, behind our `Simulator` protocol.

Where is what: `environments` says which can be driven, makes one at 20 Hz and keeps what it writes on classes to
itself; `route_line` asks it where its ego shall go and draws the way there, `road_map` the lanes; `live_road` gives it
controls and reads its vehicles; `criteria` judges; `simulator` is what others import.
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
