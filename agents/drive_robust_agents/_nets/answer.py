"""How `simlingo` answers before it drives: its network's parts in turn, on any engine.

`read` reads image and prompt, `say` reads one word after the other and scores the next, `plan` reads the queries. The
likeliest word is said, always. The time grows with the longest answer of the batch; the bits of a row do not depend on
the others, because every step works on the same shapes. No torch here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents._nets.prompts import ANSWER_SLOTS
from drive_robust_agents._nets.words import CLOSING, PAD

__all__ = ["GENERATE", "answer_and_drive"]

GENERATE = "generate"
"""What agents call it: a method of a network that the network itself does not have."""

_Arrays = Mapping[str, NDArray[Any]]


def answer_and_drive(compute: Callable[[str, _Arrays], _Arrays], inputs: _Arrays) -> dict[str, NDArray[Any]]:
    """Return what `plan` gives after the answer, and `answer` int64 (N, 16): numbers of words, then filler."""
    prompt = inputs["prompt"]
    rows = len(prompt)
    answer = np.full((rows, ANSWER_SLOTS), PAD, dtype=np.int64)
    talking = np.ones(rows, dtype=bool)
    read = compute("read", inputs)
    for place in range(ANSWER_SLOTS):
        word = read["scores"].argmax(axis=1)
        answer[:, place] = np.where(talking, word, PAD)
        talking &= word != CLOSING
        said = {"place": np.full(rows, place, dtype=np.int64), "words": np.concatenate((prompt, answer), axis=1)}
        read = compute("say", {**said, "past": read["cache"]})
        if not talking.any():
            break
    plan = compute("plan", {"words": np.concatenate((prompt, answer), axis=1), "past": read["cache"]})
    return {**plan, "answer": answer}
