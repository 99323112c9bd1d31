"""What this machine computes: digests of a few fixed results, stored with the episodes of agents that depend on it.

The world, the perturbations and agents with `portable_bits` give the same bits on every machine. What other agents do
is computed by numpy, the C library and torch, which choose their code by what the processor can do: their episodes may
differ where these digests do. They are no part of any key.
"""

from __future__ import annotations

import functools
import hashlib
import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.domain.agent import has_portable_bits
from pytest_drive_robust.domain.result import ANY_MACHINE, MACHINE_FACTS

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult

__all__ = ["machine_facts", "with_machine"]

_NAME, _TORCH = MACHINE_FACTS
_SIZE = 37
"""No multiple of any vector width: the ends of loops are computed, too. So small that no library uses several threads,
because their number changes the bits of a product."""


def with_machine(result: EpisodeResult, agent: object) -> EpisodeResult:
    """Return the result with the digests of this machine among its versions. `agent` is who drove."""
    return replace(result, versions={**result.versions, **machine_facts(agent)})


def machine_facts(agent: object = None) -> Mapping[str, str]:
    """Return 12 hex digits of what numpy and the C library compute here, and of torch when the agent holds any of it.

    For an agent whose bits do not depend on them that is `ANY_MACHINE`. Nothing is imported for it but numpy: an agent
    that holds something of torch has imported it. What other agents imported does not matter, so that an episode gets
    the same entries in every process and order.
    """
    if has_portable_bits(agent):
        return {_NAME: ANY_MACHINE}
    facts = {_NAME: _of_numpy()}
    if agent is not None and "torch" in sys.modules and _holds_torch(agent):
        facts[_TORCH] = _of_torch()
    return facts


@functools.cache
def _of_numpy() -> str:
    import numpy as np

    line = np.linspace(-3.0, 3.0, _SIZE)
    square = np.sin(np.outer(line, line + 0.1))
    results: list[Any] = []
    for kind in (np.float64, np.float32):
        values, matrix = line.astype(kind), square.astype(kind)
        results += [np.sin(values), np.exp(values), np.tanh(values), np.arctan2(values, values[::-1])]
        results += [np.hypot(values, 0.3), np.power(np.abs(values), kind(0.7)), values.sum(), matrix.sum(axis=0)]
        results += [matrix @ values, matrix @ matrix, np.einsum("ij,j->i", matrix, values)]
    results.append(np.linalg.solve(square + 20.0 * np.eye(_SIZE), line))
    results.append(np.fft.rfft(line))
    scalar = [(math.sin(x), math.exp(x), math.tanh(x), math.hypot(x, 0.3), abs(x) ** 0.7) for x in line.tolist()]
    results.append(np.array(scalar))
    return _digest(np.ascontiguousarray(result).tobytes() for result in results)


@functools.cache
def _of_torch() -> str:
    torch: Any = sys.modules["torch"]
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.no_grad():
            line = torch.linspace(-3.0, 3.0, _SIZE, dtype=torch.float32, device="cpu")
            square = torch.sin(torch.outer(line, line + 0.1))
            image = square[: _SIZE - 1].reshape(1, 3, 12, _SIZE)
            kernel = square[:9, :9].reshape(3, 3, 3, 3)
            results = [
                torch.tanh(line), torch.exp(line), torch.sigmoid(line), torch.softmax(square, 1), square @ line,
                square @ square, torch.nn.functional.conv2d(image, kernel),
                torch.nn.functional.layer_norm(square, (_SIZE,)),
            ]  # fmt: skip
            return _digest(result.contiguous().numpy().tobytes() for result in results)
    finally:
        torch.set_num_threads(threads)


def _digest(pieces: Iterable[bytes]) -> str:
    digest = hashlib.blake2b(digest_size=6)
    for piece in pieces:
        digest.update(piece)
    return digest.hexdigest()


def _holds_torch(agent: object) -> bool:
    """Return whether the agent, what it keeps, or the module that it is written in, has something of torch."""
    module = sys.modules.get(type(agent).__module__)
    kept = (*getattr(agent, "__dict__", {}).values(), *getattr(module, "__dict__", {}).values())
    return _is_torch(agent) or any(map(_is_torch, kept))


def _is_torch(value: object) -> bool:
    kinds = value.__mro__ if isinstance(value, type) else type(value).__mro__
    names = [kind.__module__ for kind in kinds]
    names += [value.__name__] if isinstance(value, type(sys)) else []
    return any(isinstance(name, str) and name.partition(".")[0] == "torch" for name in names)
