"""What was around the ego and what the agent meant to do, in whole centimetres: for people who look, not for scores."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Ints = NDArray[np.int32]

__all__ = ["Tracks"]


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Everything near the ego at the beginning of every `every_ticks`-th tick, and now and then the agent's plan.

    All tables are int32. Sample `k` is the world at the beginning of tick `k * every_ticks`.

    `actors` is (n, 6), one row for each stretch of time in which an actor was there: id, `ActorKind`, length and width
    in cm, first sample, number of samples. `motion` is (sum of samples, 4), those of one actor after those of the one
    before: x and y in cm, yaw in mrad (not wrapped), `ActorState`. `lights` is (samples, stop lines): `LightState`.

    `plans` is (m, 4): the tick whose ego the plan was made for, then how many points are path, targets and speeds.
    `points` is (sum of those, 2): forward and right of that ego in dm, the points of one plan after the other.
    """

    every_ticks: int
    actors: Ints
    motion: Ints
    lights: Ints
    plans: Ints
    points: Ints
