"""The same (agent, route, setting, seed) gives the same bits: in any order, in any process."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation, Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.embedded.routes import named_routes

SETTINGS = ("clean", "3 s burst frame drop and GPS noise 5 m", "occlusion 0.5 and 200 ms latency")
ROUTE_IDS = ("801", "3201", "4401")


class Spy:
    """Drives by GPS towards the plan and remembers a digest of every byte that it was given."""

    def sensors(self) -> list[CameraSpec]:
        return [
            CameraSpec("front", width_px=64, height_px=36),
            CameraSpec("left", yaw_deg=-55, width_px=48, height_px=32),
        ]

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.digest = hashlib.blake2b(repr(route).encode())

    def act(self, observation: Observation) -> Control:
        for name in sorted(observation.cameras):
            image = observation.cameras[name]
            self.digest.update(image.pixels.tobytes() + str(image.tick).encode())
            image.pixels[:] = 7  # scribbling must not change what comes next
        self.digest.update(repr((observation.gps, observation.speed, observation.imu, observation.compass)).encode())
        return Control(throttle=0.35, steer=0.02 * (observation.tick % 7 - 3))


def fingerprints(order: list[tuple[str, str]]) -> dict[str, str]:
    routes = {route.id: route for route in named_routes("full")}
    simulator, agent = EmbeddedSimulator(SimulatorOptions(tick_cap=120)), Spy()
    found = {}
    for route_id, setting in order:
        result = drive_episode(
            simulator, agent, route=routes[route_id], setting=Setting.parse(setting), seed=5, agent_name="spy"
        )
        assert result.ticks > 50, result.end_detail
        found[f"{route_id} {setting}"] = f"{result.trace.digest} {agent.digest.hexdigest()}"
    return found


ORDER = [(route_id, setting) for route_id in ROUTE_IDS for setting in SETTINGS]


def test_order_and_process_change_nothing() -> None:
    forwards = fingerprints(ORDER)
    backwards = fingerprints(ORDER[::-1])
    assert backwards == forwards
    assert len(set(forwards.values())) == len(ORDER)
    here = os.path.dirname(__file__)
    code = f"import sys; sys.path.insert(0, {here!r}); import {__name__} as t; print(t.fingerprints(t.ORDER))"
    fresh = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": "77"},
    )  # fmt: skip
    assert fresh.stdout.strip() == str(forwards)
