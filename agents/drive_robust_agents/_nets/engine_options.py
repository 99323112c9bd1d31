"""Check the options of an engine: its name, the device, the type and the threads that it computes with."""

from __future__ import annotations

from collections.abc import Mapping

from drive_robust_agents._nets import require
from pytest_drive_robust.errors import UnknownNameError, UsageError

__all__ = ["ENGINES", "device_of", "require_possible"]

ENGINES: Mapping[str, tuple[str, ...]] = {"onnx": ("onnxruntime", "numpy"), "torch": ("torch", "numpy")}
"""The packages whose versions decide the bits of a network, by engine."""

_TYPES = ("float32", "bfloat16", "float16")


def require_possible(engine: str, dtype: str, threads: int) -> None:
    """Raise `UsageError` for an impossible engine, dtype or thread number, and when torch is needed but missing."""
    for what, given, known in (("engine", engine, tuple(ENGINES)), ("dtype", dtype, _TYPES)):
        if given not in known:
            raise UnknownNameError.of(f"{what} of a network", given, known)
    if threads < 1 or (engine == "onnx" and dtype != "float32"):
        raise UsageError(
            f"threads={threads} with engine={engine!r}, dtype={dtype!r}: expected float32 and 1 or more; "
            "engine='torch' has mixed precision."
        )
    if engine == "torch":
        require("torch", extra="torch")


def device_of(given: str, engine: str) -> str:
    """Return the device of that name. Raises `UsageError` when this machine has none."""
    if engine == "onnx":
        if given not in ("auto", "cpu"):
            raise UsageError(
                f"device={given!r} with engine='onnx': expected 'cpu' or 'auto'; engine='torch' computes on CUDA."
            )
        return "cpu"
    import torch

    if given == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        kind = torch.device(given).type
    except RuntimeError:
        kind = ""
    if kind not in ("cpu", "cuda") or (kind == "cuda" and not torch.cuda.is_available()):
        raise UsageError(
            f"device={given!r} with engine={engine!r}: expected 'cpu', 'auto', or with a CUDA build of torch and a "
            f"device that it sees 'cuda' (torch {torch.__version__} sees {torch.cuda.device_count()})."
        )
    return given
