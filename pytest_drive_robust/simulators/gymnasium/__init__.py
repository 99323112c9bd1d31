"""`gymnasium:ID`: highway-env's environments, and any that is built like them, behind our `Simulator` protocol.

`highway-env:ID` is the same with the road stepped by our compiled copy of highway-env's semantics
(`simulators.compat`), for the environments that the copy knows.

Where is what: `ids` says which environments can be driven and names their routes; `environments` makes one at 20 Hz,
`compiled` one with the compiled road; `destinations` asks it where its ego shall go, `route_line` draws the way there,
`road_map` the lanes; `vehicles` turns a control into its action; `live_road` reads its vehicles; `criteria` judges;
`class_attributes` keeps what it writes on classes to itself; `simulator` is the door.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UsageError

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.base import SimulatorOptions
    from pytest_drive_robust.simulators.gymnasium.simulator import GymnasiumSimulator

__all__ = ["compiled_simulator", "gymnasium_simulator"]


def gymnasium_simulator(options: SimulatorOptions, identifier: str = "") -> GymnasiumSimulator:
    """The world of `--drive-sim gymnasium:IDENTIFIER`. Raises `UsageError` for an id that cannot be driven."""
    _require(identifier, "gymnasium")
    from pytest_drive_robust.simulators.gymnasium.simulator import GymnasiumSimulator

    return GymnasiumSimulator(identifier, options)


def compiled_simulator(options: SimulatorOptions, identifier: str = "") -> GymnasiumSimulator:
    """The world of `--drive-sim highway-env:IDENTIFIER`. Raises `UsageError` for an id that cannot be driven so."""
    _require(identifier, "highway-env")
    from pytest_drive_robust.simulators.gymnasium.simulator import CompiledSimulator

    return CompiledSimulator(identifier, options)


def _require(identifier: str, prefix: str) -> None:
    if not identifier:
        raise UsageError(f"the simulator {prefix!r} needs an environment: give {prefix}:ID, as in {prefix}:merge-v0.")
