"""Agents that load weights from a file, or want a device, before they drive."""

from __future__ import annotations

import io
import os
import pickle
from pathlib import Path

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.errors import UsageError

NO_GPU = "Found no NVIDIA driver on your system. Please check that you have an NVIDIA GPU and installed a driver."


class Loads:
    """Loads its weights as `torch.load(weights_only=False)` does: whatever the file says is done."""

    def __init__(self) -> None:
        with open(os.environ["DRIVE_ROBUST_TEST_WEIGHTS"], "rb") as file:
            self.weights = self.load(file.read())

    def load(self, data: bytes) -> object:
        return pickle.loads(data)

    def sensors(self) -> list[CameraSpec]:
        return []

    def reset(self, route: GlobalPlan, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Control:
        return Control(throttle=1.0)


class Blank(Loads):
    def __init__(self) -> None:
        self.weights = None


class LoadsInReset(Loads):
    def __init__(self) -> None:
        pass

    def reset(self, route: GlobalPlan, seed: int) -> None:
        Loads.__init__(self)


class LoadsWeightsOnly(Loads):
    """Refuses whatever is no number, as `torch.load(weights_only=True)` does."""

    def load(self, data: bytes) -> object:
        return _NumbersOnly(io.BytesIO(data)).load()


class _NumbersOnly(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> object:
        raise pickle.UnpicklingError(f"Weights only load failed. Unsupported global: GLOBAL {module}.{name}")


class LoadsByTorch(Loads):
    def load(self, data: bytes) -> object:
        import torch

        return torch.load(io.BytesIO(data), weights_only=True)


class WantsAGpu(Blank):
    """As torch does where there is none."""

    def __init__(self) -> None:
        raise RuntimeError(NO_GPU)


class WantsAGpuInReset(Blank):
    def reset(self, route: GlobalPlan, seed: int) -> None:
        raise RuntimeError(NO_GPU)


class GpuFactory:
    """Says before anything is driven that it cannot make an agent here."""

    __name__ = "GpuFactory"

    def __call__(self) -> Blank:
        return WantsAGpu()

    def check(self) -> None:
        raise UsageError(f"the agent needs a GPU and this machine has none: {NO_GPU}")


wants_a_gpu = GpuFactory()


def write_bomb(weights: Path, note: Path, deed: str) -> None:
    """Write weights whose loading notes the process in which they were loaded, and then does a deed."""

    class Bomb:
        def __reduce__(self) -> tuple[object, ...]:
            noted = f"open({str(note)!r}, 'a').write(f'{{os.getpid()}}\\n')"
            return exec, (f"import os, signal\n{noted}\n{deed}",)

    weights.write_bytes(pickle.dumps(Bomb()))
