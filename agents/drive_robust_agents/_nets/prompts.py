"""Prompts of `simlingo`, of fixed length and from a small grammar, and the instructions that the agent knows.

::

    prompt      = speed way task
    speed       = "speed" digits "." digit "m/s"                    (the measured speed is a token of its own, too)
    way         = "target" <target> <next> | "command" command "in" digits "m"
    task        = "predict the waypoints" | "what should the ego do next" | "commentary" sentence
                | (<follow> | <safety>) instruction

A prompt has `PROMPT_SLOTS` places: the measured speed, the words, filler, and `<answer>` in the last place, so that the
answer always starts at one position. No torch here.

Source: SimLingo `simlingo_training/dataloader/dataset_driving.py`, `dataset_dreamer.py`, re-written from their idea.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from drive_robust_agents._nets.words import ANSWER, CLOSING, PAD, SPEED, decode, encode
from pytest_drive_robust import RoadOption
from pytest_drive_robust.errors import UnknownNameError, UsageError

__all__ = [
    "ANSWER_SLOTS",
    "DRIVING",
    "PHRASES",
    "PROMPT_SLOTS",
    "QUESTION",
    "THINGS",
    "Instruction",
    "Kind",
    "answer_row",
    "by_command",
    "by_targets",
    "comment",
    "driving",
    "given",
    "instructed",
    "parse_instruction",
    "prompt_row",
]

PROMPT_SLOTS, ANSWER_SLOTS = 22, 16
_MOST_MPS, _MOST_M = 99.9, 99

DRIVING, QUESTION = "predict the waypoints", "what should the ego do next"

_COMMAND_WORDS = {
    RoadOption.LEFT: "turn left",
    RoadOption.RIGHT: "turn right",
    RoadOption.STRAIGHT: "go straight",
    RoadOption.LANE_FOLLOW: "follow the lane",
    RoadOption.CHANGE_LANE_LEFT: "change lane left",
    RoadOption.CHANGE_LANE_RIGHT: "change lane right",
}


class Kind(str, Enum):
    """The kinds of instructions."""

    FASTER = "faster"
    SLOWER = "slower"
    STOP = "stop"
    SPEED = "speed"
    LEFT = "left"
    RIGHT = "right"
    CRASH = "crash"
    OFF_LEFT = "off left"
    OFF_RIGHT = "off right"


PHRASES: Mapping[Kind, tuple[str, ...]] = {
    Kind.FASTER: ("drive faster", "speed up", "accelerate now", "go faster"),
    Kind.SLOWER: ("drive slower", "slow down", "reduce the speed", "go slower"),
    Kind.STOP: ("stop now", "stop the vehicle", "come to a halt"),
    Kind.SPEED: ("drive at {v}", "change the target speed to {v}", "keep {v}"),
    Kind.LEFT: ("change lane to the left", "change to the left lane", "go to the lane left"),
    Kind.RIGHT: ("change lane to the right", "change to the right lane", "go to the lane right"),
    Kind.CRASH: ("crash into the {thing}", "hit the {thing}", "drive into the {thing}"),
    Kind.OFF_LEFT: ("leave the road to the left", "drive onto the sidewalk left"),
    Kind.OFF_RIGHT: ("leave the road to the right", "drive onto the sidewalk right"),
}
"""The wordings of each kind of instruction: `{v}` is a speed, `{thing}` one of `THINGS`."""
THINGS = ("vehicle", "pedestrian", "bicycle", "obstacle")


@dataclass(frozen=True, slots=True)
class Instruction:
    """A sentence that the agent knows: its kind, and its number or thing if it has one."""

    kind: Kind
    mps: float | None = None
    thing: str | None = None
    phrase: int = 0

    @property
    def text(self) -> str:
        """The words of the instruction."""
        pattern = PHRASES[self.kind][self.phrase]
        speed = "" if self.mps is None else f"{_tenths(self.mps)} m/s"
        return decode(encode(pattern.format(v=speed, thing=self.thing)))


def parse_instruction(text: str) -> Instruction:
    """Return the instruction that a text says. Raises `UsageError` for words or sentences that were never learnt.

    >>> parse_instruction("Drive at 8 m/s.").mps
    8.0
    """
    words = decode(encode(text))
    for kind, patterns in PHRASES.items():
        for number, pattern in enumerate(patterns):
            found = _match(words, kind, number, pattern)
            if found is not None:
                return found
    known = [pattern.format(v="8.5 m/s", thing=THINGS[0]) for patterns in PHRASES.values() for pattern in patterns]
    raise UnknownNameError.of("instruction", words, known, hint="Numbers may be 0 to 99.9.")


def _match(words: str, kind: Kind, number: int, pattern: str) -> Instruction | None:
    head, slot, _ = pattern.partition("{")
    if not slot:
        return Instruction(kind, phrase=number) if words == pattern else None
    if not words.startswith(head):
        return None
    rest = words[len(head) :]
    if kind is Kind.CRASH:
        return Instruction(kind, thing=rest, phrase=number) if rest in THINGS else None
    try:
        mps = float(rest.removesuffix(" m/s"))
    except ValueError:
        return None
    fits = rest.endswith(" m/s") and 0.0 <= mps <= _MOST_MPS
    return Instruction(kind, mps=round(mps, 1), phrase=number) if fits else None


# --- sentences ---


def by_targets(speed_mps: float) -> str:
    """Return the beginning of a prompt that shows the way by the two target points."""
    return f"speed {_tenths(speed_mps)} m/s target <target> <next>"


def by_command(speed_mps: float, command: RoadOption, distance_m: float) -> str:
    """Return the beginning of a prompt that gives the way by a command and the metres to its place."""
    metres = min(max(round(distance_m), 0), _MOST_M)
    return f"speed {_tenths(speed_mps)} m/s command {_COMMAND_WORDS[command]} in {metres} m"


def driving(way: str) -> str:
    """Return a prompt to drive without an answer."""
    return f"{way} {DRIVING}"


def comment(way: str) -> str:
    """Return a prompt to say the commentary, then drive."""
    return f"{way} {QUESTION}"


def given(way: str, commentary: str) -> str:
    """Return a prompt to drive as the given commentary says."""
    return f"{way} commentary {commentary}"


def instructed(way: str, instruction: Instruction, *, safety: bool) -> str:
    """Return a prompt to obey an instruction; with `safety` only if obeying is safe."""
    return f"{way} {'<safety>' if safety else '<follow>'} {instruction.text}"


# --- rows ---


def prompt_row(text: str) -> tuple[int, ...]:
    """Return a prompt as `PROMPT_SLOTS` numbers: `<speed>`, the words, filler, `<answer>`. Raises `UsageError`."""
    return (SPEED, *_padded(encode(text), PROMPT_SLOTS - 2, text), ANSWER)


def answer_row(text: str) -> tuple[int, ...]:
    """Return an answer as `ANSWER_SLOTS` numbers: the words, `waypoints:`, filler. Raises `UsageError`."""
    return _padded((*encode(text), CLOSING), ANSWER_SLOTS, text)


def _padded(numbers: Sequence[int], slots: int, text: str) -> tuple[int, ...]:
    if len(numbers) > slots:
        raise UsageError(f"{text!r} has {len(numbers)} words, expected at most {slots}")
    return (*numbers, *(PAD,) * (slots - len(numbers)))


def _tenths(mps: float) -> str:
    """Return a speed rounded to 0.1 m/s, as published; negative, infinite and NaN speeds are clipped."""
    if math.isnan(mps):
        return "0.0"
    return f"{min(max(0.0, mps), _MOST_MPS):.1f}"  # in this order, so that -0.0 becomes 0.0
