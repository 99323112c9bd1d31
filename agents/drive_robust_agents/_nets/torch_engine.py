"""Eager torch on a CPU or a CUDA device: the engine for a GPU, and the reference for the graphs."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

__all__ = ["TYPES", "TorchEngine"]

TYPES = {"float32": None, "bfloat16": torch.bfloat16, "float16": torch.float16}
"""The type of automatic mixed precision, by the name of a `dtype`; None: no mixed precision."""


class TorchEngine:
    """Eager PyTorch: inference mode, channels-last, optional mixed precision."""

    def __init__(self, net: nn.Module, *, device: str = "cpu", dtype: str = "float32", threads: int = 1) -> None:
        self._device, self._threads = torch.device(device), threads
        self.net: Any = net.to(self._device)
        self._dtype = TYPES[dtype]
        if self._device.type == "cuda":
            torch.backends.cudnn.benchmark = False
            torch.backends.cudnn.deterministic = True

    def __call__(self, method: str, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Run the network with one copy to the device and one back; the device has finished on return."""
        if torch.get_num_threads() != self._threads:
            torch.set_num_threads(self._threads)
        with torch.inference_mode(), self._precision():
            given = {name: torch.from_numpy(np.ascontiguousarray(value)) for name, value in inputs.items()}
            if self._device.type == "cuda":
                given = {name: value.pin_memory().to(self._device, non_blocking=True) for name, value in given.items()}
            outputs: dict[str, Tensor] = getattr(self.net, method)(**given)
            found = {name: _plain(value) for name, value in outputs.items()}
        if self._device.type == "cuda":
            torch.cuda.synchronize(self._device)
        return found

    def _precision(self) -> AbstractContextManager[Any]:
        return nullcontext() if self._dtype is None else torch.autocast(self._device.type, self._dtype)


def _plain(value: Tensor) -> NDArray[Any]:
    plain: NDArray[Any] = (value.float() if value.is_floating_point() else value).cpu().numpy()
    return plain
