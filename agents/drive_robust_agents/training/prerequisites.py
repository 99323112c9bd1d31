"""Check the requirements of a training on the machine before any work is done."""

from __future__ import annotations

import argparse
import math
import re

from drive_robust_agents._nets import require
from pytest_drive_robust.errors import UsageError

__all__ = ["TRAINING", "require_device", "require_packages", "require_positive"]

TRAINING = ("torch", "safetensors", "onnx", "scipy", "rich")
"""The packages of the extra `train`."""

_DEVICE = re.compile(r"cpu|cuda(?::(\d+))?")


def require_packages(*packages: str) -> None:
    """Raise `UsageError`, with the install command, when packages of the extra `train` are missing."""
    require(*packages, extra="train")


def require_device(name: str) -> None:
    """Raise `UsageError` when torch cannot compute on the device of `--device`: `cpu`, `cuda` or `cuda:1`."""
    known = _DEVICE.fullmatch(name)
    if known is None:
        raise UsageError(
            f"--device {name}: expected cpu, cuda (the first NVIDIA GPU that torch sees) or cuda:1 (the second)."
        )
    if name == "cpu":
        return
    import torch

    if not torch.cuda.is_available():
        raise UsageError(f"--device {name}: torch {torch.__version__} sees no CUDA device here. Give cpu.")
    count = torch.cuda.device_count()
    if int(known[1] or 0) >= count:
        raise UsageError(f"--device {name}: torch sees {count} here, cuda:0 to cuda:{count - 1}. Give one of these.")


def require_positive(given: argparse.Namespace, *options: str) -> None:
    """Raise `UsageError` for the first of these options that was given a number which is not above 0."""
    for name in options:
        value = getattr(given, name)
        if value is not None and not 0 < value < math.inf:
            raise UsageError(f"--{name} is {value}, expected a number above 0.")
