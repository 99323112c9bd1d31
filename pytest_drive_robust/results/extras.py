"""Imports optional libraries that only some exports need."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from pytest_drive_robust.errors import UsageError


def require(module: str, extra: str) -> ModuleType:
    """Import a module of an optional dependency. Raises `UsageError` with the command that installs it."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        name = error.name or module
        raise UsageError(
            f"this export needs {name}, which is not installed: pip install 'pytest-drive-robust[{extra}]'."
        ) from None
