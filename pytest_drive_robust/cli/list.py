"""`drive-robust list`: agents, perturbations, simulators, metrics and routes, and where each comes from."""

from __future__ import annotations

import argparse

from pytest_drive_robust.cli.routes import print_sets
from pytest_drive_robust.cli.tables import LEFT, print_table, say
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.perturbations import Perturbation
from pytest_drive_robust.registry.entries import KINDS
from pytest_drive_robust.registry.registry import Registry, default_registry

_LISTS = (*KINDS, "routes")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `list`."""
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"{', '.join(_LISTS)}; default: all")
    parser.set_defaults(command=_list)


def _list(options: argparse.Namespace) -> int:
    for kind in options.kinds or _LISTS:
        if kind not in _LISTS:
            raise UnknownNameError.of("list", kind, _LISTS)
        if kind == "routes":
            print_sets()
        else:
            _print_kind(kind, default_registry())
    for problem in default_registry().problems():
        say(f"left out: {problem}")
    return 0


def _print_kind(kind: str, registry: Registry) -> None:
    if kind != "perturbations":
        print_table({"name": LEFT, "origin": LEFT}, registry.names(kind), title=kind)
        return
    classes = registry.perturbations()
    rows = [(name, _sentence(classes.get(name)), origin) for name, origin in registry.names(kind)]
    print_table({"name": LEFT, "in a requirement": LEFT, "origin": LEFT}, rows, title=kind)


def _sentence(cls: type[Perturbation] | None) -> str:
    """Return an example sentence of a failure; empty if the failure does not load or has no usual severity."""
    try:
        return "" if cls is None else str(cls(**cls.example))
    except Exception:  # a user's class may raise anything
        return ""
