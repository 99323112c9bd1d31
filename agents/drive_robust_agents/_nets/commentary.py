"""The grammar of what `simlingo` says about its driving: an action and its reason. No torch here.

::

    answer     = sentence | "follow instruction" | "ignore instruction and" sentence
    sentence   = action [reason]

Source of the form: the commentary of SimLingo (`simlingo_training`, `dataset_generation/language_labels`): what the
ego does, then why. The sentences are our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from drive_robust_agents._nets.words import decode, encode
from pytest_drive_robust.errors import UnknownNameError

__all__ = ["FOLLOWING", "Action", "Commentary", "Reason", "parse_commentary", "refusal"]

FOLLOWING = "follow instruction"
_REFUSING = "ignore instruction and"


class Action(str, Enum):
    """What the ego does next."""

    REMAIN = "remain stopped"
    STOP = "stop"
    SLOW = "slow down"
    KEEP = "maintain speed"
    GO = "accelerate"


class Reason(str, Enum):
    """Why; `NONE` where the situation tells no reason."""

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
    """Return the answer to an unsafe instruction: it is ignored, and this is done instead."""
    return f"{_REFUSING} {commentary.text}"


def parse_commentary(text: str) -> tuple[bool, Commentary]:
    """Parse an answer: (refuses an instruction, sentence). Raises `UsageError` for a text outside the grammar."""
    words = decode(encode(text))
    refuses = words.startswith(_REFUSING)
    said = words[len(_REFUSING) :].lstrip() if refuses else words
    known = {Commentary(action, reason).text: Commentary(action, reason) for action in Action for reason in Reason}
    if said not in known:
        raise UnknownNameError.of("commentary", said, known)
    return refuses, known[said]
