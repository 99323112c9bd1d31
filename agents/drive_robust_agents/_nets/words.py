"""The closed vocabulary of `simlingo`: every word that the agent reads or writes, and a strict tokenizer.

`simlingo` is no language model: words outside its training have no meaning, so a word that is not in the list is an
error and never a guess. Numbers are spelt digit by digit: `8.5 m/s` is `8 . 5 m/s`. No torch here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from pytest_drive_robust.errors import UnknownNameError, UsageError

__all__ = ["ANSWER", "CLOSING", "FOLLOW", "NEXT", "PAD", "SAFETY", "SPEED", "TARGET", "VOCABULARY", "decode", "encode"]

SPECIALS = ("<pad>", "<speed>", "<target>", "<next>", "<follow>", "<safety>", "<answer>", "waypoints:")
"""Filler; the place of the measured speed; the places of the two target points; an instruction that must be obeyed,
one that may be refused; the end of a prompt; the end of an answer."""

_NUMBERS = (*"0123456789", ".", "m", "m/s")
_PROMPT = "predict the waypoints what should ego do next speed target command commentary in"
_COMMANDS = "follow lane turn left right go straight change to"
_INSTRUCTIONS = (
    "drive faster slower stop accelerate slow down up now at reduce come a halt keep crash into hit leave road onto "
    "sidewalk ignore"
)
_THINGS = "red yellow green light sign vehicle pedestrian bicycle obstacle emergency"
_COMMENTARY = (
    "because of ahead is clear remain stopped maintain limit pass wait for gap traffic behind curve junction "
    "instruction and"
)
_TEXT = " ".join((_PROMPT, _COMMANDS, _INSTRUCTIONS, _THINGS, _COMMENTARY))

VOCABULARY: tuple[str, ...] = (*SPECIALS, *_NUMBERS, *_TEXT.split())
"""All words; a word's number is its place. New words must go to the end, because old weights keep their numbers."""

_NUMBER_OF = {word: number for number, word in enumerate(VOCABULARY)}
PAD, SPEED, TARGET, NEXT, FOLLOW, SAFETY, ANSWER, CLOSING = range(len(SPECIALS))

_TOKEN = re.compile(r"(?P<word><[a-z]+>|waypoints:|m/s|[a-z]+|\d|(?<=\d) ?\.(?= ?\d))|[.,;:!?]|(?P<other>\S+)")


def encode(text: str) -> tuple[int, ...]:
    """Return the numbers of the words; case and punctuation are ignored. Raises `UsageError` for an unknown word.

    >>> decode(encode("Drive at 8.5 m/s!"))
    'drive at 8.5 m/s'
    """
    numbers = []
    for found in _TOKEN.finditer(text.lower()):
        if found.lastgroup is None:
            continue
        word = found.group().strip()
        if word not in _NUMBER_OF:
            raise UnknownNameError.of("word", word, _writable(), hint=f"simlingo cannot read {text!r}.")
        numbers.append(_NUMBER_OF[word])
    return tuple(numbers)


def decode(numbers: Iterable[int]) -> str:
    """Return the words of the numbers, without filler. Raises `UsageError` for an unknown number."""
    words = []
    for number in numbers:
        if not 0 <= number < len(VOCABULARY):
            raise UsageError(f"{number} is no word: expected 0..{len(VOCABULARY) - 1}")
        if number != PAD:
            words.append(VOCABULARY[number])
    return re.sub(r"(?<=[0-9.]) (?=[0-9.])", "", " ".join(words))


def _writable() -> list[str]:
    return [word for word in VOCABULARY if word.isalpha()]
