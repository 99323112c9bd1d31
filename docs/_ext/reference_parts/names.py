"""What is registered, and every public name."""

from __future__ import annotations

import inspect

import pytest_drive_robust as package
from pytest_drive_robust import errors, testing
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.registry.entries import KINDS
from pytest_drive_robust.registry.registry import default_registry
from reference_parts.rst import escaped, heading, list_table


def names() -> str:
    """Return what is registered where this package and the reference agents are installed."""
    lines: list[str] = []
    for kind in KINDS:
        rows = [(f"``{name}``", escaped(origin)) for name, origin in default_registry().names(kind)]
        lines += [*heading(kind.capitalize(), "~"), "", list_table(("name", "origin"), rows), ""]
    return "\n".join(lines)


def public_names() -> str:
    """Return every name of `pytest_drive_robust`."""
    listed = [name for name in package.__all__ if not name.startswith("__")]
    return "\n".join(
        line for name in listed for line in _documented("pytest_drive_robust", name, getattr(package, name))
    )


def testing_names() -> str:
    """Return every name of `pytest_drive_robust.testing`."""
    return "\n".join(
        line
        for name in testing.__all__
        for line in _documented("pytest_drive_robust.testing", name, getattr(testing, name))
    )


def error_names() -> str:
    """Return every class of error."""
    found = [name for name in errors.__all__ if inspect.isclass(getattr(errors, name))]
    return "\n".join(f".. autoexception:: pytest_drive_robust.errors.{name}\n" for name in found)


def _documented(module: str, name: str, value: object) -> list[str]:
    if inspect.isclass(value):
        members = ["   :members:", "   :undoc-members:"] if not issubclass(value, Perturbation) else []
        return [f".. autoclass:: {module}.{name}", *members, ""]
    return [f".. autofunction:: {module}.{name}", ""]
