"""The entries that come with this package."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence

from pytest_drive_robust.metrics.table import METRICS
from pytest_drive_robust.registry.entries import Entry, from_reference

BUILT_IN = "built in"
"""The origin of the entries that come with this package."""

_REFERENCES: Mapping[str, Sequence[tuple[str, str, str]]] = {
    "agents": (("leaderboard", "pytest_drive_robust.bench2drive.agents.factory:leaderboard_agent", "FILE+CONFIG"),),
    "simulators": (
        ("embedded", "pytest_drive_robust.simulators.embedded:EmbeddedSimulator", ""),
        ("gymnasium", "pytest_drive_robust.simulators.gymnasium:gymnasium_simulator", "ID"),
        ("bench2drive", "pytest_drive_robust.bench2drive.evaluator.by_pytest:official_evaluator", ""),
    ),
}
"""The built-in entries of each kind: name, reference, and the argument that may follow the name."""


def is_built_in_simulator(name: str) -> bool:
    """Return whether a simulator of this package has that name."""
    return any(name == ours for ours, _, _ in _REFERENCES["simulators"])


def built_in_entries(kind: str) -> list[Entry]:
    """Return the entries of one of `KINDS` that come with this package."""
    if kind == "metrics":
        return [Entry(kind, name, BUILT_IN, functools.partial(getattr, METRICS[name], "measure")) for name in METRICS]
    if kind == "perturbations":
        from pytest_drive_robust.perturbations import BUILTIN

        return [Entry(kind, name, BUILT_IN, functools.partial(BUILTIN.__getitem__, name)) for name in BUILTIN]
    return [
        Entry(kind, name, BUILT_IN, from_reference(kind, path).loader, argument=argument)
        for name, path, argument in _REFERENCES[kind]
    ]
