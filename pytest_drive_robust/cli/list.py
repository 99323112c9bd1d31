"""`drive-robust list`: agents, perturbations, simulators, metrics and routes, and where each comes from."""

from __future__ import annotations

import argparse

from pytest_drive_robust.cli.routes import print_sets
from pytest_drive_robust.cli.tables import LEFT, print_table, say
from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.registry.registry import KINDS, default_registry

_LISTS = (*KINDS, "routes")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `list`."""
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"{', '.join(_LISTS)}; all when left out")
    parser.set_defaults(command=_list)


def _list(options: argparse.Namespace) -> int:
    for kind in options.kinds or _LISTS:
        if kind not in _LISTS:
            raise UnknownNameError.of("list", kind, _LISTS)
        if kind == "routes":
            print_sets()
        else:
            print_table({"name": LEFT, "origin": LEFT}, default_registry().names(kind), title=kind)
        if kind == "perturbations":
            default_registry().perturbations()
            for problem in default_registry().problems():
                say(f"does not load: {problem}")
    return 0
