"""The project of a user, to be written into a folder and sent to a cluster: a slow world and agents that break."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from pytest_drive_robust.engine.worker_setup import WorkerSetup
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.simulators.base import SimulatorOptions

MODULE = "project_on_a_cluster"
SOURCE = """
import ctypes, os, time
from pathlib import Path

from pytest_drive_robust import Control, Perturbation
from pytest_drive_robust.testing import FakeSimulator

FOLDER = Path({folder!r})
HERE = Path(__file__).resolve().parent


class Halve(Perturbation):
    phrase = "halved throttle"

    def actuate(self, tick, control, inference_s):
        return None if control is None else Control(throttle=control.throttle / 2.0, steer=control.steer)


class SlowSimulator(FakeSimulator):
    def reset(self, route, *, seed, cameras):
        with (FOLDER / "begun.log").open("a") as log:
            log.write(f"{{route.id}} {{HERE}}\\n")
        return super().reset(route, seed=seed, cameras=cameras)

    def step(self, control):
        time.sleep({tick_s!r})
        return super().step(control)


class Steady:
    def sensors(self):
        return ()

    def reset(self, route, seed):
        self.calls = 0

    def act(self, observation):
        self.calls += 1
        if self.calls == 30:
            self.fault()
        return Control(throttle=1.0)

    def fault(self):
        pass


class Raises(Steady):
    def fault(self):
        raise ZeroDivisionError("no way")


class Segfaults(Steady):
    def fault(self):
        ctypes.string_at(0)


class Leaves(Steady):
    def fault(self):
        os._exit(0)


class Hangs(Steady):
    def fault(self):
        time.sleep(600.0)


class WithGpu(Steady):
    num_gpus = 1

    def fault(self):
        (FOLDER / "devices").write_text(os.environ.get("CUDA_VISIBLE_DEVICES", "unset"))


class WithManyGpus(Steady):
    num_gpus = 8


class Weighted(Steady):
    weights = [HERE / "weights.bin"]


AGENTS = (Steady, Raises, Segfaults, Leaves, Hangs, WithGpu, WithManyGpus, Weighted)


def pytest_drive_robust_register(registry):
    registry.register_perturbation(Halve)
    registry.register_simulator("slow", SlowSimulator)
    for agent in AGENTS:
        registry.register_agent(agent.__name__.lower(), agent)
"""


def write_project(folder: Path, *, tick_s: float) -> Path:
    """Write the module into its folder, with a file of weights beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{MODULE}.py"
    file.write_text(SOURCE.format(folder=str(folder), tick_s=tick_s))
    (folder / "weights.bin").write_bytes(b"0123")
    return file


def load_project(file: Path) -> Registry:
    """Load the names of the project in this process."""
    spec = importlib.util.spec_from_file_location(MODULE, file)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[MODULE] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    registry = Registry()
    module.pytest_drive_robust_register(registry)
    return registry


def setup_of(file: Path) -> WorkerSetup:
    """Return what another process needs to come to the same names."""
    folder = str(file.parent)
    options = SimulatorOptions(tick_cap=60)
    return WorkerSetup((folder, *sys.path), folder, ((MODULE, str(file)),), "slow", options)
