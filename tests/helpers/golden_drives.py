"""What each agent with shipped weights plans on one fixed drive, tick by tick: `golden/NAME.json`.

Every agent whose weights ship (`weights/manifest.json`) is asked along the same three seconds of a left turn at a
junction with lights. The vehicle follows a fixed script, not the agent: so the agent sees the same pictures on every
machine, and nothing that rounds differently there is fed back. The file holds waypoints, target points and controls of
every tenth tick.

When weights, or what an agent does with them, were changed on purpose, write the files again from the repository root::

    python tests/helpers/golden_drives.py

and read the difference before you commit it. `python tests/helpers/golden_drives.py NAME` prints what one agent does,
to the last bit.
"""

from __future__ import annotations

import functools
import json
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import onnxruntime

import drive_robust_agents
from pytest_drive_robust import Control
from pytest_drive_robust.domain.observation import Image
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.route_sets import named_routes

if TYPE_CHECKING:
    from pytest_drive_robust import CameraSpec, GlobalPlan, Observation
    from pytest_drive_robust.domain.agent import Agent

__all__ = ["COMMAND", "Drive", "Spoil", "drive", "label", "read", "shipped"]

COMMAND = "python tests/helpers/golden_drives.py"

_FOLDER = Path(__file__).parents[1] / "contracts" / "golden"

_SCENARIO = "SignalizedJunctionLeftTurn"
_TICKS, _EVERY, _DIGITS = 60, 10, 5

Numbers = list[float]
Drive = list[dict[str, Numbers]]
"""One entry for each kept tick: lists of numbers by name."""
Spoil = Callable[["Observation"], "Observation"]


def shipped() -> dict[str, dict[str, object]]:
    """Return the manifest of the weights that ship, by the name of the agent."""
    manifest = Path(drive_robust_agents.__file__).parent / "weights" / "manifest.json"
    entries: dict[str, dict[str, object]] = json.loads(manifest.read_bytes())
    return entries


def label(name: str) -> str:
    """Return which weights: `tcp@0.1:5c7f488d`."""
    entry = shipped()[name]
    return f"{name}@{entry['version']}:{str(entry['sha256'])[:8]}"


def drive(agent: Agent, *, spoil: Spoil = lambda seen: seen, ticks: int = _TICKS) -> Drive:
    """Ask an agent along the fixed drive, or its beginning; `spoil` changes what it is given."""
    plan, seen = _seen(tuple(agent.sensors()))
    agent.reset(plan, 0)
    kept: Drive = []
    for tick in range(ticks):
        control = agent.act(spoil(seen[tick]))
        if tick % _EVERY == _EVERY - 1:
            kept.append(_moment(agent, control))
    return kept


@functools.cache
def _seen(cameras: tuple[CameraSpec, ...]) -> tuple[GlobalPlan, Sequence[Observation]]:
    """Return the plan, and what any agent with these cameras is given: what it answers changes nothing."""
    route = next(route for route in named_routes("one-per-scenario") if route.scenario.type == _SCENARIO)
    world = EmbeddedSimulator(SimulatorOptions())
    world.reset(route, seed=0, cameras=cameras)
    seen = []
    for tick in range(_TICKS):
        seen.append(world.observe().map_images(_copied))  # the next pictures are drawn over these
        world.step(Control(throttle=0.7, steer=0.12 * math.sin(0.1 * tick)))
    return world.plan(), seen


def _copied(_: str, image: Image) -> Image:
    return Image(image.pixels.copy(), image.tick)


def read(name: str) -> dict[str, Any]:
    """Read the file of an agent; empty when there is none."""
    file = _FOLDER / f"{name}.json"
    found: dict[str, Any] = json.loads(file.read_bytes()) if file.exists() else {}
    return found


def _write(name: str) -> None:
    driven = drive(default_registry().agent(name))
    rounded = [{key: [round(value, _DIGITS) for value in values] for key, values in one.items()} for one in driven]
    about = {"weights": label(name), "simulator": EmbeddedSimulator.version, "onnxruntime": onnxruntime.__version__}
    lines = ",\n ".join(json.dumps(one) for one in rounded)
    _FOLDER.mkdir(exist_ok=True)
    (_FOLDER / f"{name}.json").write_text(f'{json.dumps(about)[:-1]}, "drive": [\n {lines}\n]}}\n')


def _moment(agent: Agent, control: Control) -> dict[str, Numbers]:
    planned = agent.plan()  # type: ignore[attr-defined] # optional in the protocol; every learned agent has it
    shown = {"path": planned.path, "speed points": planned.speed_points, "target points": planned.target_points}
    flat = {name: [float(value) for point in points for value in point] for name, points in shown.items()}
    return flat | {"control": [control.throttle, control.steer, control.brake]}


def main(names: list[str]) -> None:
    """Write the files of all agents, or print what some do."""
    for name in names:
        print(json.dumps(drive(default_registry().agent(name))))
    for name in () if names else shipped():
        _write(name)
        print(f"golden/{name}.json: {label(name)}")


if __name__ == "__main__":
    main(sys.argv[1:])
