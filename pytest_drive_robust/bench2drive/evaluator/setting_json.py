"""A setting as the text that travels into another Python: `inject.py` reads it there."""

from __future__ import annotations

import json

from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations import BUILTIN, Setting

__all__ = ["DT_S", "setting_as_json"]

DT_S = 0.05
"""Seconds per tick of the official evaluator (Bench2Drive `leaderboard/leaderboard_evaluator.py`, `frame_rate`)."""


def setting_as_json(setting: Setting, *, seed: int, log: str = "") -> str:
    """Return the value of `PDR_SETTING`. `log` is where the injected schedule is written, `""` for nowhere.

    Raises `PerturbationError` for a perturbation that did not come with this package: its code is not known there.
    """
    names = {cls: name for name, cls in BUILTIN.items()}
    foreign = [item for item in setting.perturbations if type(item) not in names]
    if foreign:
        raise PerturbationError(
            f"{str(foreign[0])!r} ({type(foreign[0]).__name__}) cannot be injected into the official evaluator, which "
            f"runs in another Python. The perturbations that can: {', '.join(sorted(BUILTIN))}."
        )
    stack = [{"name": names[type(item)], "parameters": item.parameters()} for item in setting.perturbations]
    document = {"seed": seed, "dt_s": DT_S, "setting": str(setting), "log": log, "stack": stack}
    return json.dumps(document, allow_nan=False)
