"""The global generators of random numbers, which an agent may draw from: seeded from the name of the episode.

Nothing of ours draws from them.
"""

from __future__ import annotations

import hashlib
import importlib.util
import random
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pytest_drive_robust.domain.episode import Episode

__all__ = ["borrowed_generators", "seed_for", "seed_generators"]


def seed_for(episode: Episode) -> None:
    """Seed the global generators for an episode: the same, whatever was driven before it."""
    seed_generators(repr(episode))


@contextmanager
def borrowed_generators(episode: Episode) -> Iterator[None]:
    """`seed_for` in a process that is not only ours: afterwards the generators are as they were."""
    import numpy.random

    torch: Any = sys.modules.get("torch")
    states = random.getstate(), numpy.random.get_state(), None if torch is None else torch.get_rng_state()
    seed_for(episode)
    try:
        yield
    finally:
        random.setstate(states[0])
        numpy.random.set_state(states[1])
        if states[2] is not None:
            torch.set_rng_state(states[2])


def seed_generators(text: str) -> None:
    """Seed the global generators of Python, numpy and torch from a name; torch's when it is imported at last."""
    import numpy.random  # also when nobody has: numpy loads it when it is first used

    seed = int.from_bytes(hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=4).digest(), "big")
    random.seed(seed)
    numpy.random.seed(seed)
    torch: Any = sys.modules.get("torch")
    if torch is not None:
        torch.manual_seed(seed)
        return
    _LATE_TORCH.seed = seed
    if _LATE_TORCH not in sys.meta_path:
        sys.meta_path.insert(0, _LATE_TORCH)


class _LateTorch(MetaPathFinder):
    """Finds torch as usual, and has it seeded as soon as it is loaded."""

    seed = 0

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != "torch":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(fullname)
        loader: Any = None if spec is None else spec.loader
        if loader is not None:
            load, seed = loader.exec_module, self.seed

            def load_and_seed(module: Any) -> None:
                load(module)
                module.manual_seed(seed)

            loader.exec_module = load_and_seed
        return spec


_LATE_TORCH = _LateTorch()
