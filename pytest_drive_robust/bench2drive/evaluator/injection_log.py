"""The log that `inject.py` keeps of a route: how many ticks a setting changed, when, and which signals."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.store.episode_fields import read_facts

_STRETCH = tuple(item.name for item in fields(Injection))


@dataclass(frozen=True, slots=True)
class Injected:
    """What the log tells of a drive: its `ticks`, those with a perturbed signal or a delayed command, and the `facts`.

    `facts` are fields of an episode by name. An empty log tells of no tick.
    """

    ticks: int = 0
    injected_ticks: int = 0
    facts: Mapping[str, Any] = field(default_factory=dict)


def injected_in(path: Path, *, route: str, setting: str, seed: int) -> Injected:
    """Return the last entry of a log; an empty one without a log, and for one that is damaged or of another drive."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        told = json.loads(lines[-1])
        if (told["route"], told["setting"], told["seed"]) != (route, setting, seed):
            return Injected()
        stretches = [dict(zip(_STRETCH, stretch, strict=True)) for stretch in told["schedule"]]
        facts = read_facts({**told, "schedule": stretches}, "schedule", "inference_s", "reception")
        return Injected(int(told["ticks"]), int(told["injected_ticks"]), facts)
    except (OSError, LookupError, TypeError, ValueError, OverflowError, RecursionError):
        return Injected()
