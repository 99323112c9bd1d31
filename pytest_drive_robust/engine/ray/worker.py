"""What runs on the nodes of a Ray cluster: a guard in each of Ray's worker processes.

A fault of the agent ends a process below the guard and is data by the time that Ray could see it. So whatever Ray
itself notices is the loss of a node or of its own worker, and worth another attempt.
"""

from __future__ import annotations

import json
import os
import pickle
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_drive_robust.engine.guard import Guard
from pytest_drive_robust.engine.nursery import Nursery
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.record import encode_episode

if TYPE_CHECKING:
    from pytest_drive_robust.engine.limits import Limits
    from pytest_drive_robust.engine.order import Order
    from pytest_drive_robust.engine.ray.packages import Luggage
    from pytest_drive_robust.engine.recipe import Recipe

__all__ = ["RECORD", "UNUSABLE", "Errand", "drive_errand", "refused"]

RECORD, UNUSABLE = b"r", b"u"
"""The first byte of a reply: a record of the store follows, or a usage error as JSON."""
_DEVICES = "CUDA_VISIBLE_DEVICES"


@dataclass(frozen=True, slots=True)
class Errand:
    """One episode for another process, perhaps on another machine.

    `luggage` is None on the machine where the run was started.
    """

    recipe: Recipe
    limits: Limits
    order: Order
    identity: str
    luggage: Luggage | None = None


class _Post:
    """The guard of this process, for one recipe and one set of devices."""

    def __init__(self, errand: Errand) -> None:
        luggage = errand.luggage
        self._recipe = errand.recipe if luggage is None else luggage.unpacked(errand.recipe)
        before = tuple(sys.path)
        self._registry = self._recipe.registry()
        sys.path += [path for path in before if path not in sys.path]  # Ray itself lives there
        self._checked: set[str] = set()
        self._nursery = Nursery(self._recipe)
        self._guard = Guard(self._nursery, errand.limits)

    def drive(self, errand: Errand) -> bytes:
        episode, route = errand.order.episode, errand.order.route
        if errand.luggage is not None and episode.agent not in self._checked:
            errand.luggage.check(self._recipe, episode.agent)
            self._checked.add(episode.agent)
        task = EpisodeRequest(episode, route, errand.order.read_setting(self._registry), errand.identity)
        return encode_episode(self._guard.drive(task))

    def close(self) -> None:
        self._guard.close()
        self._nursery.close()


_posts: dict[tuple[Recipe, Limits, str | None], _Post] = {}


def drive_errand(content: bytes) -> bytes:
    """Drive a pickled `Errand`; `RECORD` with the record, or `UNUSABLE` with why there is none. A task of Ray's."""
    errand: Errand = pickle.loads(content)
    place = errand.recipe, errand.limits, os.environ.get(_DEVICES)
    try:
        if place not in _posts:
            while _posts:  # Ray gave this process other devices: children that saw the old ones are of no use
                _posts.popitem()[1].close()
            _posts[place] = _Post(errand)
        return RECORD + _posts[place].drive(errand)
    except UsageError as error:
        return UNUSABLE + refused(error)


def refused(error: UsageError) -> bytes:
    """A usage error on its way to the controller."""
    return json.dumps({"type": type(error).__name__, "text": str(error)}).encode()
