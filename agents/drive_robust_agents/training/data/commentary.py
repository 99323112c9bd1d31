"""The grammar of `simlingo`'s commentary on its driving: an action and its reason. No torch here.

::

    answer     = sentence | "follow instruction" | "ignore instruction and" sentence
    sentence   = action [reason]

Source of the form (action, then reason): the commentary of SimLingo (`simlingo_training`,
`dataset_generation/language_labels`). The sentences are our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

__all__ = ["FOLLOWING", "Action", "Commentary", "Reason", "refusal"]

FOLLOWING = "follow instruction"
_REFUSING = "ignore instruction and"


class Action(str, Enum):
    """The next action of the ego."""

    REMAIN = "remain stopped"
    STOP = "stop"
    SLOW = "slow down"
    KEEP = "maintain speed"
    GO = "accelerate"


class Reason(str, Enum):
    """The reason of an action; `NONE` where the situation gives no reason."""

    NONE = ""
    RED = "because of the red light"
    YELLOW = "because of the yellow light"
    GREEN = "because the light is green"
    SIGN = "because of the stop sign"
    VEHICLE = "because of the vehicle ahead"
    FOLLOW = "and follow the vehicle ahead"
    PEDESTRIAN = "because of the pedestrian ahead"
    OBSTACLE = "because of the obstacle ahead"
    PASS = "and pass the obstacle ahead"
    GAP = "and wait for a gap in traffic"
    JUNCTION = "because of the junction ahead"
    CURVE = "because of the curve ahead"
    SIREN = "because of the emergency vehicle behind"
    LIMIT = "because of the speed limit"
    CLEAR = "because the road is clear"


@dataclass(frozen=True, slots=True)
class Commentary:
    """One sentence."""

    action: Action
    reason: Reason = Reason.NONE

    @property
    def text(self) -> str:
        """The words: `stop because of the red light`."""
        return f"{self.action.value} {self.reason.value}".rstrip()


def refusal(commentary: Commentary) -> str:
    """Return the answer to an unsafe instruction: the instruction is ignored, and `commentary` is done instead."""
    return f"{_REFUSING} {commentary.text}"
