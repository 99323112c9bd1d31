"""The state of a training on disk: one safetensors file for the whole state, written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import safetensors
import safetensors.torch
import torch
from torch import Tensor, nn

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.whole_file import whole_file

__all__ = ["States"]

_KEPT = 2


class States:
    """The last states of a run, in `RUN/state/`. A file is named by its step and renamed into place when complete."""

    def __init__(self, run: Path) -> None:
        self._folder = run / "state"

    def save(
        self, step: int, net: nn.Module, shadow: nn.Module, optimizer: torch.optim.Optimizer, facts: Mapping[str, Any]
    ) -> None:
        """Save everything that the next step depends on; keep one older state and remove the others."""
        self._folder.mkdir(parents=True, exist_ok=True)
        tensors = {f"net.{name}": value for name, value in net.state_dict().items()}
        tensors |= {f"shadow.{name}": value for name, value in shadow.state_dict().items()}
        for number, values in optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{number}.{name}": value for name, value in values.items()}
        content = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
        path = self._folder / f"{step:09d}.safetensors"
        with whole_file(path) as temporary:
            safetensors.torch.save_file(content, temporary, metadata={"facts": json.dumps({"step": step, **facts})})
        for old in self._files()[:-_KEPT]:
            old.unlink()

    def latest(self) -> dict[str, Any] | None:
        """Return the facts of the last state, or None when there is no state."""
        files = self._files()
        if not files:
            return None
        with _opened(files[-1]) as file:
            facts: dict[str, Any] = json.loads(file.metadata()["facts"])
        return facts

    def restore(self, net: nn.Module, shadow: nn.Module, optimizer: torch.optim.Optimizer) -> None:
        """Put the last state into a new network, its average and a new optimizer. Raises `UsageError`."""
        path = self._files()[-1]
        with _opened(path) as file:
            tensors: dict[str, Tensor] = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        try:
            net.load_state_dict(_below(tensors, "net."))
            shadow.load_state_dict(_below(tensors, "shadow."))
        except RuntimeError as error:
            raise UsageError(f"{path} is a state of another network: {error}. Give a new --run folder.") from None
        parameters = [parameter for group in optimizer.param_groups for parameter in group["params"]]
        kept: dict[int, dict[str, Tensor]] = {}
        for name, value in _below(tensors, "optimizer.").items():
            number, _, part = name.partition(".")
            own = parameters[int(number)]
            # the fused kernel walks through memory, so optimizer state needs the memory layout of its parameter
            laid = torch.empty_like(own).copy_(value) if value.shape == own.shape else value
            kept.setdefault(int(number), {})[part] = laid
        optimizer.load_state_dict({"state": kept, "param_groups": optimizer.state_dict()["param_groups"]})

    def _files(self) -> list[Path]:
        return sorted(self._folder.glob("*.safetensors"))


def _opened(path: Path) -> Any:
    try:
        return safetensors.safe_open(str(path), framework="pt")
    except (OSError, safetensors.SafetensorError) as error:
        raise UsageError(f"the state {path} cannot be read: {error}. Remove it to go on from the one before.") from None


def _below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
