"""`drive-robust`: what one wants to know without writing a test."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence

from pytest_drive_robust.cli import doctor as cli_doctor
from pytest_drive_robust.cli import regression as cli_regression
from pytest_drive_robust.cli import replay as cli_replay
from pytest_drive_robust.cli import routes as cli_routes
from pytest_drive_robust.cli import score as cli_score
from pytest_drive_robust.cli import store as cli_store
from pytest_drive_robust.errors import DriveRobustError, UnknownNameError

__all__ = ["main"]

_LISTS = ("agents", "perturbations", "simulators", "metrics", "routes")
_USAGE_ERROR = 4  # pytest's exit code for the same mistake


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command. Returns the exit code: 0, 1 for a broken contract, 4 for what we cannot use."""
    options = _parser().parse_args(arguments)
    try:
        _register_names(options.plugins)
        code: int = options.command(options)
    except DriveRobustError as error:
        print(f"drive-robust: {error}", file=sys.stderr)
        return _USAGE_ERROR
    return code


def _register_names(plugins: Iterable[str]) -> None:
    """As pytest does it for `-p` and for a `conftest.py`."""
    for word in plugins:
        from pytest_drive_robust.registry.plugins import register_names_of
        from pytest_drive_robust.registry.registry import default_registry

        register_names_of(word, default_registry())


def _parser() -> argparse.ArgumentParser:
    from pytest_drive_robust import __version__

    parser = argparse.ArgumentParser("drive-robust", description="Closed-loop robustness of driving policies.")
    parser.add_argument(
        "-p",
        dest="plugins",
        action="append",
        default=[],
        metavar="PLUGIN",
        help="a module or the path of a conftest.py that registers names of its own; may be repeated",
    )
    parser.add_argument("--version", action="version", version=f"drive-robust {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    listing = commands.add_parser("list", help="what is there, and where it comes from")
    listing.add_argument("kinds", nargs="*", metavar="KIND", help=f"{', '.join(_LISTS)}; all when left out")
    listing.set_defaults(command=_list)
    cli_routes.add_commands(commands)
    cli_regression.add_commands(commands)
    cli_score.add_commands(commands)
    cli_doctor.add_command(commands)

    check = commands.add_parser("check-agent", help="does an agent keep the contract?")
    check.add_argument("agent", metavar="NAME", help="a name out of `list agents`, or module:Factory")
    check.set_defaults(command=_check_agent)
    check.add_argument("--seed", type=int, default=0, help="default: 0")
    check.add_argument("--sim", default="embedded", metavar="NAME", help="default: embedded")
    check.add_argument("--routes", metavar="SET", help="a set (full, dev10), a file, or FILE:id,id")
    cli_replay.add_command(commands)
    cli_store.add_command(commands)
    return parser


def _list(options: argparse.Namespace) -> int:
    from pytest_drive_robust.registry.registry import default_registry

    for kind in options.kinds or _LISTS:
        if kind not in _LISTS:
            raise UnknownNameError.of("list", kind, _LISTS)
        if kind == "routes":
            cli_routes.print_sets()
        else:
            _print_table(kind, ("name", "origin"), default_registry().names(kind))
    return 0


def _check_agent(options: argparse.Namespace) -> int:
    from pytest_drive_robust.options.run import RunOptions
    from pytest_drive_robust.registry.registry import default_registry
    from pytest_drive_robust.runner.routes import default_spec, routes_for
    from pytest_drive_robust.simulators.base import SimulatorOptions
    from pytest_drive_robust.testing import check_agent

    registry = default_registry()
    registry.agent(options.agent)  # an unknown name is said at once, before a world is built
    simulator = registry.simulator(options.sim, SimulatorOptions(tick_cap=200))
    routes = routes_for(options.routes or default_spec(RunOptions(), simulator), simulator)
    kept = True
    try:
        for number, route in enumerate(routes if options.routes else routes[:1], start=1):
            report = check_agent(
                lambda: registry.agent(options.agent),
                simulator=simulator,
                route=route,
                other_route=routes[number % len(routes)],
                seed=options.seed,
                subject=f"{options.agent} on {route.label}",
            )
            print(report)
            kept = kept and report.ok
    finally:
        simulator.close()
    return 0 if kept else 1


def _print_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else 120, markup=False, highlight=False).print(table)
