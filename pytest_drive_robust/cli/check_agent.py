"""`drive-robust check-agent`: does an agent keep the contract?"""

from __future__ import annotations

import argparse
from typing import cast

from pytest_drive_robust.cli.pytest_options import add_pytest_option
from pytest_drive_robust.options.option import GivenText
from pytest_drive_robust.options.parsers import check_seeds, time_limit_s
from pytest_drive_robust.options.run import DEFAULT_ROUTES
from pytest_drive_robust.registry.registry import AgentFactory, default_registry
from pytest_drive_robust.runner.before_driving import check_factory, routes_of
from pytest_drive_robust.runner.cache_key.identity import agent_identity
from pytest_drive_robust.runner.driver import make_agent
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.routes import default_spec
from pytest_drive_robust.testing import check_agent

_TICK_CAP = 200
_NAME_COLUMNS = len("declarations")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `check-agent`."""
    parser.description = (
        "Drives an agent for some seconds, again and again, and says what of the contract it keeps: methods, controls "
        "in range, the same ones for the same seed, nothing left of the last episode, no ground truth."
    )
    parser.add_argument("agent", metavar="NAME", help="a name from `drive-robust list agents`, or module:Class")
    parser.add_argument("--seed", type=int, default=0, help="seed of the episodes; default: 0")
    add_pytest_option(parser, "--sim")
    add_pytest_option(parser, "--act-timeout")
    parser.add_argument(
        "--routes",
        metavar="SET",
        help="check on these routes: a set (full, one-per-scenario, dev10), a file, or FILE:id,id; default: one route",
    )
    parser.set_defaults(command=_check_agent)


def _check_agent(options: argparse.Namespace) -> int:
    check_seeds([options.seed], source="--seed")
    act_timeout_s = time_limit_s(GivenText("--act-timeout", options.act_timeout))
    registry = default_registry()
    factory = cast("AgentFactory", registry.entry("agents", options.agent).load())
    check_factory(options.agent, factory)  # what a run refuses is said at once, before a world is built
    make_agent(registry, options.agent)
    agent_identity(options.agent, registry)  # weights that are not there
    simulator = registry.simulator(options.sim, SimulatorOptions(tick_cap=_TICK_CAP))
    chosen = options.routes is not None
    spec = options.routes if chosen else default_spec(DEFAULT_ROUTES, simulator, given=False)
    routes = routes_of(spec, simulator)
    kept = True
    try:
        for number, route in enumerate(routes if chosen else routes[:1], start=1):
            subject = f"{options.agent} on {route.label}"
            print(f"{subject}:", flush=True)
            report = check_agent(
                factory,
                simulator=simulator,
                route=route,
                other_route=routes[number % len(routes)],
                seed=options.seed,
                subject=subject,
                act_timeout_s=act_timeout_s,
                told=lambda check: print(check.line(_NAME_COLUMNS), flush=True),
            )
            print(report.verdict)
            kept = kept and report.ok
    finally:
        simulator.close()
    return 0 if kept else 1
