"""Finds the clean setting that a setting of a stored run is compared with."""

from __future__ import annotations

from contextlib import suppress

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.perturbations.severity_text import split_outside_quotes
from pytest_drive_robust.registry.registry import Registry, default_registry


def clean_sentence(setting: str, registry: Registry | None = None) -> str:
    """Return the sentence of the clean drive that `setting` is compared with.

    The result is `"clean"`, or a clean drive with equal warm-up. A perturbation that `registry`, by default that of
    this process, does not know has no warm-up.
    """
    known = (default_registry() if registry is None else registry).perturbations()
    try:
        return str(Setting.parse(setting, known).baseline)
    except UsageError:  # a stored run may hold a user's perturbation that cannot be imported here
        stack = Setting.CLEAN
        for sentence in split_outside_quotes(setting, r"\s+and\s+"):
            with suppress(UsageError):
                stack += Setting.parse(sentence, known)
        return str(stack.baseline)
