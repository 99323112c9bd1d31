"""Seeds the global generators of random numbers by a name. An agent may draw from them; our code never does."""

from __future__ import annotations

import hashlib
import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pytest_drive_robust.runner.episode.after_import import AfterImport


@contextmanager
def borrowed_generators(text: str) -> Iterator[None]:
    """Seed the global generators by a name, and restore them after the body, also for a torch imported in the body."""
    import numpy.random

    python, numbers, late_seed, torch = random.getstate(), numpy.random.get_state(), _LATE_TORCH.seed, _torch()
    state = None if torch is None else _state_of(torch)
    seed_generators(text)
    try:
        yield
    finally:
        random.setstate(python)
        numpy.random.set_state(numbers)
        torch = _torch()
        if torch is None:
            _LATE_TORCH.wait(late_seed)
        elif state is None and late_seed is not None:  # an outer block waits for torch, too
            torch.manual_seed(late_seed)
        else:
            _put_back(torch, _LATE_TORCH.first_state if state is None else state)


def seed_generators(text: str) -> None:
    """Seed the global generators of Python, numpy and torch by a name; seed torch later when it is not yet imported."""
    import numpy.random  # numpy itself loads it only at its first use

    seed = int.from_bytes(hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=4).digest(), "big")
    random.seed(seed)
    numpy.random.seed(seed)
    torch = _torch()
    if torch is not None:
        torch.manual_seed(seed)
    else:
        _LATE_TORCH.wait(seed)


def _torch() -> Any:
    return sys.modules.get("torch")


def _state_of(torch: Any) -> tuple[Any, Any]:
    """Return the states of torch's CPU generator and of its CUDA generators; None for CUDA before its first use."""
    return torch.get_rng_state(), torch.cuda.get_rng_state_all() if torch.cuda.is_initialized() else None


def _put_back(torch: Any, state: tuple[Any, Any]) -> None:
    cpu, cuda = state
    torch.set_rng_state(cpu)
    if cuda is None:  # CUDA was seeded together with the CPU, and unused
        torch.cuda.manual_seed_all(torch.initial_seed())
    else:
        torch.cuda.set_rng_state_all(cuda)


class _LateTorch:
    """Seeds torch as soon as it is loaded. `first_state` is torch's state before that."""

    seed: int | None = None
    first_state: Any = None

    def __init__(self) -> None:
        self._import = AfterImport("torch", self._seed)

    def wait(self, seed: int | None) -> None:
        """Seed torch with `seed` when it is loaded; with None, do not seed it."""
        self.seed = seed
        if seed is None:
            self._import.forget()
        else:
            self._import.wait()

    def _seed(self, torch: Any) -> None:
        self.first_state = _state_of(torch)
        torch.manual_seed(self.seed)


_LATE_TORCH = _LateTorch()
