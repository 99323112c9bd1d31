"""`drive-robust`: what one wants to know without writing a test."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from pytest_drive_robust import cli_routes
from pytest_drive_robust.errors import DriveRobustError, UnknownNameError

if TYPE_CHECKING:
    from pytest_drive_robust.domain.result import EpisodeResult

__all__ = ["main"]

_LISTS = ("agents", "perturbations", "simulators", "metrics", "routes")
_USAGE_ERROR = 4  # pytest's exit code for the same mistake


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command. Returns the exit code: 0, 1 for a broken contract, 4 for what we cannot use."""
    options = _parser().parse_args(arguments)
    try:
        code: int = options.command(options)
    except DriveRobustError as error:
        print(f"drive-robust: {error}", file=sys.stderr)
        return _USAGE_ERROR
    return code


def _parser() -> argparse.ArgumentParser:
    from pytest_drive_robust import __version__

    parser = argparse.ArgumentParser("drive-robust", description="Closed-loop robustness of driving policies.")
    parser.add_argument("--version", action="version", version=f"drive-robust {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    listing = commands.add_parser("list", help="what is there, and where it comes from")
    listing.add_argument("kinds", nargs="*", metavar="KIND", help=f"{', '.join(_LISTS)}; all when left out")
    listing.set_defaults(command=_list)
    cli_routes.add_commands(commands)

    check = commands.add_parser("check-agent", help="does an agent keep the contract?")
    check.add_argument("agent", metavar="NAME", help="a name out of `list agents`, or module:Factory")
    check.set_defaults(command=_check_agent)

    replay = commands.add_parser("replay", help="drive one route again, clean and perturbed")
    replay.add_argument("route", metavar="ROUTE", help="the id of a route")
    replay.add_argument("--agent", required=True, metavar="NAME", help="a name out of `list agents`, or module:Factory")
    replay.add_argument("--setting", default="clean", metavar="SENTENCE", help='such as "200 ms latency"')
    replay.add_argument("--stuck-stop", metavar="SECONDS", help="as --drive-stuck-stop of the run that is replayed")
    replay.set_defaults(command=_replay)

    for command in (check, replay):
        command.add_argument("--seed", type=int, default=0, help="default: 0")
        command.add_argument("--sim", default="embedded", metavar="NAME", help="default: embedded")
        command.add_argument("--routes", metavar="SET", help="a set (full, dev10), a file, or FILE:id,id")
    return parser


def _list(options: argparse.Namespace) -> int:
    from pytest_drive_robust.registry import default_registry

    for kind in options.kinds or _LISTS:
        if kind not in _LISTS:
            raise UnknownNameError.of("list", kind, _LISTS)
        if kind == "routes":
            cli_routes.print_sets()
        else:
            _print_table(kind, ("name", "origin"), default_registry().names(kind))
    return 0


def _check_agent(options: argparse.Namespace) -> int:
    from pytest_drive_robust.registry import default_registry
    from pytest_drive_robust.runner.routes import default_spec, routes_for
    from pytest_drive_robust.settings import Settings
    from pytest_drive_robust.simulators.base import SimulatorOptions
    from pytest_drive_robust.testing import check_agent

    registry = default_registry()
    registry.agent(options.agent)  # an unknown name is said at once, before a world is built
    simulator = registry.simulator(options.sim, SimulatorOptions(tick_cap=200))
    routes = routes_for(options.routes or default_spec(Settings(), simulator), simulator)
    kept = True
    try:
        for route in routes if options.routes else routes[:1]:
            report = check_agent(
                lambda: registry.agent(options.agent),
                simulator=simulator,
                route=route,
                seed=options.seed,
                subject=f"{options.agent} on {route.label}",
            )
            print(report)
            kept = kept and report.ok
    finally:
        simulator.close()
    return 0 if kept else 1


def _replay(options: argparse.Namespace) -> int:
    from pytest_drive_robust.perturbations.setting import Setting
    from pytest_drive_robust.registry import default_registry
    from pytest_drive_robust.requirements.evaluate import first_divergence_s
    from pytest_drive_robust.runner.loop import drive_episode
    from pytest_drive_robust.runner.routes import own_routes, routes_for
    from pytest_drive_robust.settings import positive_seconds
    from pytest_drive_robust.simulators.base import SimulatorOptions
    from pytest_drive_robust.simulators.embedded.routes import ALL_ROUTES

    registry = default_registry()
    setting = Setting.parse(options.setting, registry.perturbations())
    stuck_stop_s = None if options.stuck_stop is None else positive_seconds("--stuck-stop", options.stuck_stop)
    agent = registry.agent(options.agent)
    simulator = registry.simulator(options.sim, SimulatorOptions(stuck_stop_s=stuck_stop_s))
    spec = options.routes or (ALL_ROUTES if own_routes(simulator) is None else options.route)
    routes = {route.id: route for route in routes_for(spec, simulator)}
    if options.route not in routes:
        raise UnknownNameError.of("route", options.route, routes, hint="Name its file with --routes.")
    check_route = getattr(simulator, "check_route", None)
    if check_route is not None:
        check_route(routes[options.route])
    results = []
    try:
        for each in (setting,) if setting.is_clean else (setting.baseline, setting):
            result = drive_episode(
                simulator,
                agent,
                route=routes[options.route],
                setting=each,
                seed=options.seed,
                agent_name=options.agent,
            )
            _print_result(result)
            results.append(result)
    finally:
        simulator.close()
    if len(results) == 2:
        diverged_s = first_divergence_s(*results)
        print("both drove the same" if diverged_s is None else f"first divergence at {diverged_s:.2f} s")
    return 0


def _print_result(result: EpisodeResult) -> None:
    """One paragraph: outcome, score, end, and every infraction with its second."""
    from pytest_drive_robust.domain.outcome import Outcome
    from pytest_drive_robust.metrics.score import driving_score

    scored = result.outcome is not Outcome.INFRA_ERROR
    score = f"DS {driving_score(result):.1f}" if scored else "not scored"
    print(f"{result.episode} ({result.scenario})")
    print(f"  {result.outcome.value}: {score}, {result.route_completion_pct:.1f} % of {result.route_length_m:.0f} m")
    print(f"  ended after {result.game_s:.2f} s ({result.wall_s:.2f} s on the clock): {result.end_detail}")
    for infraction in result.infractions:
        print(f"  {infraction.tick * result.dt_s:7.2f} s  {infraction.kind.value}: {infraction.detail}")
    print(f"  trajectory {result.trace.digest}")


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


if __name__ == "__main__":
    raise SystemExit(main())
