"""Random numbers that are the same with every version of numpy and on every machine.

numpy promises the words of its bit generators, but not the numbers that it makes of these words (NEP 19). This module
takes only the 64-bit words of a Philox generator (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC
2011) and turns these words into numbers by plain arithmetic.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Tuple, TypeVar  # noqa: UP035 - the official evaluator's Python 3.7 imports this file

from pytest_drive_robust.arithmetic.scalars import cos_sin, log

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

Item = TypeVar("Item")

_UNIT = 2.0**-53
_HALF_WORD = 0xFFFFFFFF

Range = Tuple[float, float]  # noqa: UP006
"""(least, greatest) value of a draw."""


class RandomNumbers:
    """A sequence of random numbers that depends only on `key`.

    `key` is two whole numbers of 64 bits, or the sixteen bytes that they are made of, least significant first.

    >>> RandomNumbers((7, 1)).uniform(2.0, 4.0) == RandomNumbers((7, 1)).uniform(2.0, 4.0)
    True
    """

    def __init__(self, key: tuple[int, int] | bytes) -> None:
        import numpy as np

        words = np.frombuffer(key, "<u8") if isinstance(key, bytes) else np.array(key, np.uint64)
        self._words = np.random.Philox(key=words)
        self._half: int | None = None  # the unused half of the last word that was split

    @classmethod
    def of(cls, *names: object) -> RandomNumbers:
        """Return the random numbers that are keyed by `names`, such as a purpose, a route and a seed."""
        return cls(hashlib.blake2b("\x1f".join(map(str, names)).encode(), digest_size=16).digest())

    def random(self) -> float:
        """Return a number, uniform in [0, 1): the upper 53 bits of a word."""
        return (int(self._words.random_raw()) >> 11) * _UNIT

    def uniform(self, low: float, high: float) -> float:
        """Return a number, uniform from `low` to `high`."""
        return low + (high - low) * self.random()

    def uniforms(self, low: float, high: float, count: int) -> Floats:
        """Return `count` numbers as `uniform` does, (count,)."""
        import numpy as np

        return np.array([self.uniform(low, high) for _ in range(count)])

    def normals(self, mean: float, deviation: float, count: int) -> Floats:
        """Return `count` normally distributed numbers, (count,)."""
        import numpy as np

        pairs = [box_muller(self.random(), self.random()) for _ in range((count + 1) // 2)]
        return mean + deviation * np.array([number for pair in pairs for number in pair][:count])

    def below(self, bound: int) -> int:
        """Return a whole number from 0 to `bound` - 1, every one as likely; `bound` at most 2**32.

        Half a word times `bound` is cut to its upper half; halves that would favour a number are skipped (Lemire, "Fast
        random integer generation in an interval", 2019). A `bound` of 1 takes no word.
        """
        if bound == 1:
            return 0
        product = self._half_word() * bound
        if product & _HALF_WORD < bound:
            least = (_HALF_WORD + 1 - bound) % bound
            while product & _HALF_WORD < least:
                product = self._half_word() * bound
        return product >> 32

    def choice(self, items: Sequence[Item]) -> Item:
        """Return one of the items, each as likely."""
        return items[self.below(len(items))]

    def _half_word(self) -> int:
        """Return the lower half of a new word, or the upper half of the last one that was split."""
        if self._half is not None:
            half, self._half = self._half, None
            return half
        word = int(self._words.random_raw())
        self._half = word >> 32
        return word & _HALF_WORD


def box_muller(u: float, v: float) -> tuple[float, float]:
    """Return two independent numbers of the standard normal distribution from two in [0, 1) (Box and Muller, 1958)."""
    reach, angle = math.sqrt(-2.0 * log(1.0 - u)), math.tau * v  # 1 - u lies in (0, 1]: the logarithm is finite
    along, beside = cos_sin(angle)
    return reach * along, reach * beside
