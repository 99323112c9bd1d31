"""The default GPUs of evaluators and their servers."""

from __future__ import annotations

from collections.abc import Mapping

from pytest_drive_robust.errors import UsageError

_VARIABLE = "CUDA_VISIBLE_DEVICES"


def visible_gpus(environment: Mapping[str, str]) -> tuple[int, ...]:
    """Return the numbers in `CUDA_VISIBLE_DEVICES`, GPU 0 where it is unset or empty.

    Raises `UsageError` for names such as `GPU-8f1c`: CARLA's servers know GPUs by number only.

    >>> visible_gpus({"CUDA_VISIBLE_DEVICES": "2,5"})
    (2, 5)
    """
    text = environment.get(_VARIABLE, "").strip()
    words = [word.strip() for word in text.split(",")] if text else ["0"]
    if not all(word.isdecimal() for word in words):
        raise UsageError(
            f"{_VARIABLE} is {text!r}, expected numbers of GPUs as in 0,1, which CARLA's servers are told too. Set it "
            "to those that the official evaluator may use."
        )
    return tuple(int(word) for word in words)
