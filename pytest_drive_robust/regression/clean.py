"""The sentence of the clean drive that a setting is compared with."""

from __future__ import annotations

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations.base import Setting

__all__ = ["clean_sentence"]


def clean_sentence(setting: str) -> str:
    """`"clean"`, or a clean drive with the same warm-up. `"clean"` too for sentences with perturbations of a user."""
    try:
        return str(Setting.parse(setting).baseline)
    except UsageError:  # stored runs are compared where the user's classes need not be importable
        return str(Setting.CLEAN)
