"""The recipe of an agent's training: its inputs, its network, its targets and its loss."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

from pytest_drive_robust.errors import UnknownNameError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor, nn

    Arrays = Mapping[str, NDArray[Any]]

__all__ = ["RECIPES", "Defaults", "TrainingRecipe", "TrainingStage", "recipe_of"]

RECIPES = {"simlingo": "SimLingoRecipe", "tcp": "TcpRecipe", "uniad": "UniadRecipe", "vad": "VadRecipe"}
"""The class of each agent's recipe in the module of that name."""


class TrainingStage(NamedTuple):
    """A stage of the training: its share of all steps, and frozen parameters (by prefix)."""

    share: float = 1.0
    frozen: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Defaults:
    """Default trainer options of a recipe: AdamW with one cycle of the learning rate."""

    batch: int = 64
    lr: float = 1e-3
    weight_decay: float = 0.01
    clip: float = 1.0
    visits: int = 1_000_000


class TrainingRecipe(Protocol):
    """One agent's training, without state, because `batch` is called in background threads.

    `needs` are the arrays of a sample that `batch` reads, `history` those that it also reads from the frame 0.5 s
    earlier, as `old_<name>`, with `old_ok` (N,) False (and zeros) in rows without an earlier frame.
    """

    name: str
    needs: tuple[str, ...]
    history: tuple[str, ...]
    stages: tuple[TrainingStage, ...]
    defaults: Defaults

    def make(self, spec: Mapping[str, Any] | None = None) -> nn.Module:
        """Return a new network of a plain specification, by default the shipped one."""
        ...

    def batch(self, arrays: Arrays, generator: np.random.Generator, training: bool) -> dict[str, Tensor]:
        """Return inputs (augmented in training) and targets; every tensor has the batch as its first axis."""
        ...

    def loss(self, net: nn.Module, batch: Mapping[str, Tensor]) -> tuple[Tensor, Mapping[str, Tensor | float]]:
        """Return the loss, and its parts without gradient, for display."""
        ...


def recipe_of(agent: str, *, robust: bool = False) -> TrainingRecipe:
    """Return an agent's recipe; `robust` adds deployment failures as augmentation. Raises `UnknownNameError`."""
    if agent not in RECIPES:
        raise UnknownNameError.of("learned agent", agent, RECIPES)
    made = getattr(import_module(f"{__package__}.{agent}"), RECIPES[agent])
    return cast("TrainingRecipe", made(robust=True) if robust else made())
