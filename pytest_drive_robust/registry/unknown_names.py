"""Errors for a name that no entry has, or that several entries have."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from pytest_drive_robust.errors import PluginError, UnknownNameError, UsageError, nearest
from pytest_drive_robust.registry.built_in import BUILT_IN
from pytest_drive_robust.registry.entries import Entry, unknown_groups

_HINTS: Mapping[str, str] = {
    "agents": "Give 'module:Class' to use your own, install a distribution that brings agents "
    "(pip install drive-robust-agents), or register one in pytest_drive_robust_register of your conftest.py "
    "(drive-robust COMMAND reads it with -p conftest.py).",
    "perturbations": "Register your own in pytest_drive_robust_register with registry.register_perturbation.",
    "simulators": "Give 'module:Class' to use your own, or register one in pytest_drive_robust_register.",
    "metrics": "Register your own in pytest_drive_robust_register with registry.register_metric.",
}


def unknown_name(kind: str, name: str, known: Mapping[str, Sequence[Entry]]) -> UnknownNameError:
    """Return the error for a name of `kind` that is not in `known`, with the nearest name and what to do."""
    argument = name.partition(":")[2]
    syntaxes = [f"{entry}:{argument}" if known[entry][0].argument and argument else entry for entry in known]
    misplaced = [str(problem) for problem in unknown_groups()]
    hint = " ".join([_module_here(kind, name) or _HINTS[kind], *misplaced])
    return UnknownNameError.of(kind.removesuffix("s"), name, syntaxes, hint=hint, listed_by=f"drive-robust list {kind}")


def unknown_agent_with_options(name: str, known: Mapping[str, Sequence[Entry]]) -> UnknownNameError:
    """Return the error for an unknown agent whose name has options, as in `blid:speed=8`."""
    bare, _, argument = name.partition(":")
    factory, _, options = argument.partition(":")
    own = f"Options need a registered name: register {bare}:{factory} under a NAME of yours, then give NAME:{options}."
    hint = own if options else _HINTS["agents"]
    return UnknownNameError.of("agent", bare, known, hint=hint, listed_by="drive-robust list agents")


def declared_twice(entries: Sequence[Entry]) -> PluginError:
    """Return the error for a name that all of `entries` have."""
    told = f"{entries[0].name!r} of {entries[0].kind} is declared by {' and '.join(entry.origin for entry in entries)}."
    if entries[0].origin == BUILT_IN:
        return PluginError(
            f"{told} The built-in one keeps the name: uninstall the other distribution, or change the name in it."
        )
    return PluginError(
        f"{told} Uninstall one of them, or decide by registering the name in pytest_drive_robust_register of your "
        "conftest.py."
    )


def is_misspelt(bare: str, known: Mapping[str, Sequence[Entry]]) -> bool:
    """Return whether `bare`, the text before a colon, resembles a name that takes an argument, and is no module."""
    close = nearest(bare, [name for name in known if known[name][0].argument])
    return close is not None and not is_module(bare)


def is_module(bare: str) -> bool:
    """Return whether `bare` can be a module: it lies in the current folder, is installed, or is in a package."""
    import importlib.util

    here = os.path.exists(f"{bare}.py") or os.path.exists(bare)  # the current folder may not be on sys.path yet
    return here or "." in bare or importlib.util.find_spec(bare) is not None


def takes_nothing(kind: str, bare: str, argument: str) -> UsageError:
    """Return the error for a known name that takes neither an argument nor this option."""
    if kind == "agents":
        return UsageError(
            f"the agent {bare!r} has no option {argument!r}: give options as {bare}:NAME=VALUE, or leave them out."
        )
    return UsageError(f"the simulator {bare!r} takes nothing after a colon, but was given {argument!r}: give {bare}.")


def _module_here(kind: str, name: str) -> str:
    """Return advice for a name that is a module or file without a class; `""` when there is no such file here."""
    module = name.removesuffix(".py").replace(os.sep, ".")
    if kind not in ("agents", "simulators") or not os.path.isfile(f"{module.replace('.', os.sep)}.py"):
        return ""
    return f"A file of that name is here: give '{module}:Class' for the class in it."
