"""What a perturbation knows of its episode, its random numbers, and its notes for the record.

A random number is a pure function of (seed, route, perturbation, sensor, tick): the names are hashed into the 128-bit
key of a Philox generator and the tick is its counter (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC
2011). So all agents meet the same masks, bursts and noise on the same route, in any process and in any order, and
nothing touches a global generator.
"""

from __future__ import annotations

import hashlib
import operator
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.arithmetic.random_numbers import box_muller
from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.errors import PerturbationError

if TYPE_CHECKING:
    Four = tuple[float, float, float, float]

_BLOCK_TICKS = 256  # one call of numpy serves 12.8 s at 20 Hz
_UNIT = 2.0**-53  # a float in [0, 1) from the upper 53 bits of a word
_PERSON = b"drive-robust v1"  # sets our keys apart from every other use of the hash; change it to change all numbers
NO_CAMERA = "the agent has no camera"
"""The `idle_reason` of a camera failure for an agent without cameras."""


class Draws:
    """The random numbers of one perturbation in one episode: four for each sensor and tick.

    `seed` is any integer, `route_id`, `stream` and `sensor` any strings. All numbers are the same to the last bit on
    every machine and with every version of numpy: numpy promises the words of its bit generators (NEP 19), and plain
    arithmetic turns these words into numbers.

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


@dataclass(frozen=True, slots=True)
class EpisodeContext:
    """What a perturbation may know of an episode: never the agent, never the ground truth, never the future.

    `cameras` are those of the agent in the order of its rig. `stream` names the perturbation within its stack
    (`"gps-noise"`, a second one `"gps-noise#2"`), so that two of a kind draw different noise.
    """

    route_id: str
    seed: int
    dt_s: float
    cameras: tuple[CameraSpec, ...]
    stream: str

    def draws(self) -> Draws:
        """Return the random numbers of this perturbation in this episode."""
        return Draws(self.seed, self.route_id, self.stream)

    def camera_key(self, name: str) -> str:
        """Return the sensor name of a camera for `Draws`: its position in the rig, `"camera 0"` for the first camera.

        Agents name their cameras as they like, `front` or `CAM_FRONT`; the position makes them meet the same pattern.
        Raises `PerturbationError` for a camera that the rig does not have.
        """
        for position, camera in enumerate(self.cameras):
            if camera.name == name:
                return f"camera {position}"
        rig = ", ".join(camera.name for camera in self.cameras) or "none"
        raise PerturbationError(
            f"{self.stream} got an image of the camera {name!r}, expected one of the agent's rig: {rig}."
        )


class Spans:
    """The ticks that a perturbation touched, for perturbations that work in every tick.

    Keeps the first tick of each signal, in the order of these ticks, and the last tick of all signals.
    """

    __slots__ = ("_first", "_last", "_stream")

    def __init__(self, stream: str) -> None:
        self._stream = stream
        self._first: dict[str, int] = {}
        self._last = 0

    def touch(self, tick: int, signals: Iterable[str]) -> None:
        """Note that `signals` were perturbed in `tick`."""
        for signal in signals:
            self._first.setdefault(signal, tick)
        self._last = tick

    def injections(self) -> tuple[Injection, ...]:
        """Return one stretch for each signal: from its first tick to the last tick of the episode."""
        return tuple(Injection(self._stream, signal, first, self._last) for signal, first in self._first.items())


def cameras_by_name(names: tuple[str, ...]) -> str:
    """Return the cameras for a sentence: `"the camera front"`, `"the cameras front, rear"`."""
    return f"the camera {names[0]}" if len(names) == 1 else f"the cameras {', '.join(names)}"
