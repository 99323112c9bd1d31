"""Let `simlingo` answer before driving: run the parts of its network in turn, on any engine.

`read` reads image and prompt, `say` reads one word after the other and scores the next word, `plan` reads the queries.
The likeliest word is always said. The time grows with the longest answer of the batch. The bits of a row do not depend
on other rows, because every step works on equal shapes. No torch here.
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
"""The method name by which agents ask for an answer; the network itself has no such method."""

_Arrays = Mapping[str, NDArray[Any]]


def answer_and_drive(compute: Callable[[str, _Arrays], _Arrays], inputs: _Arrays) -> dict[str, NDArray[Any]]:
    """Return the outputs of `plan` after the answer, and `answer` int64 (N, 16): numbers of words, then filler."""
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
