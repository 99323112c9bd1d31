"""Random numbers without a state: each is a pure function of (seed, route, perturbation, sensor, tick).

The names are hashed into the 128-bit key of a Philox generator and the tick is its counter (Salmon et al., "Parallel
random numbers: as easy as 1, 2, 3", SC 2011). So all agents meet the same masks, bursts and noise on the same route,
in any process and in any order, and nothing touches a global generator.
"""

from __future__ import annotations

import hashlib
import operator
from typing import TYPE_CHECKING

from pytest_drive_robust.arithmetic.random_numbers import box_muller

__all__ = ["Draws"]

if TYPE_CHECKING:
    Four = tuple[float, float, float, float]

_BLOCK_TICKS = 256  # one call of numpy serves 12.8 s at 20 Hz
_UNIT = 2.0**-53  # a float in [0, 1) from the upper 53 bits of a word
_PERSON = b"drive-robust v1"  # sets our keys apart from every other use of the hash; change it to change all numbers


class Draws:
    """The random numbers of one perturbation in one episode: four for each sensor and tick.

    `seed` is any integer, `route_id`, `stream` and `sensor` any strings. All numbers are the same to the
    last bit on every machine and with every version of numpy, which promises the words of its bit generators (NEP 19);
    what becomes of them is plain arithmetic.

    >>> draws = Draws(7, "2091", "gps-noise")
    >>> draws.normal("gps", 30) == Draws(7, "2091", "gps-noise").normal("gps", 30)
    True
    >>> draws.normal("gps", 30) == draws.normal("gps", 31)
    False
    """

    __slots__ = ("_blocks", "_names")

    def __init__(self, seed: int, route_id: str, stream: str) -> None:
        self._names = (str(operator.index(seed)), route_id, stream)
        self._blocks: dict[str, tuple[int, list[Four]]] = {}

    def uniform(self, sensor: str, tick: int) -> Four:
        """Return four independent numbers, uniform in [0, 1). `tick` counts from 0."""
        number, row = divmod(tick, _BLOCK_TICKS)
        cached = self._blocks.get(sensor)
        if cached is None or cached[0] != number:
            cached = self._blocks[sensor] = (number, _block(_key((*self._names, sensor)), number))
        return cached[1][row]

    def normal(self, sensor: str, tick: int) -> Four:
        """Return four independent numbers of the standard normal distribution (Box and Muller, 1958)."""
        u, v, w, z = self.uniform(sensor, tick)
        return (*box_muller(u, v), *box_muller(w, z))


def _key(names: tuple[str, ...]) -> int:
    """Return 128 bits of the names. Each is preceded by its length, so that ("a", "bc") and ("ab", "c") differ."""
    digest = hashlib.blake2b(digest_size=16, person=_PERSON)
    for name in names:
        encoded = name.encode("utf-8", "surrogatepass")
        digest.update(len(encoded).to_bytes(8, "little") + encoded)
    return int.from_bytes(digest.digest(), "little")


def _block(key: int, number: int) -> list[Four]:
    """Return the numbers of `_BLOCK_TICKS` ticks: a step of the counter gives four words of 64 bits, one row."""
    import numpy as np

    generator = np.random.Philox(key=key, counter=number * _BLOCK_TICKS)
    words = generator.random_raw(4 * _BLOCK_TICKS).reshape(_BLOCK_TICKS, 4)
    return [(u, v, w, z) for u, v, w, z in ((words >> np.uint64(11)) * _UNIT).tolist()]
