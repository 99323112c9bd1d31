"""What a scenario type is: one function that puts actors on a `Stage`, and the sites where routes for it are drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pytest_drive_robust.simulators.embedded.stage import Stage

Metres = tuple[float, float]
"""A range from which something is drawn, of metres or of whatever its element holds."""


@dataclass(frozen=True, slots=True)
class Site:
    """Where the generator draws routes for a scenario type.

    `chain` names a chain of lanes of the town style, or several with lane changes between them:
    `"ramp.f0>road.right"`. `before_m` metres lie between the start and the chain's anchor (its first junction, on ramps
    where the parallel lane begins or parts); with None the route starts anywhere. `length_m` and `trigger_m` are
    ranges, the latter measured from the start of the route, and so is `changes_m`: where each lane change begins.
    `texts` are parameter elements whose value is a word: `(("direction", "left"),)`.
    """

    style: str
    chain: str
    length_m: Metres
    trigger_m: Metres = (4.0, 14.0)
    before_m: Metres | None = None
    changes_m: tuple[Metres, ...] = ()
    texts: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class ScenarioType:
    """One of the 44 situations.

    `parameters` are the ranges from which the generator draws the XML's parameter elements; elements that hold an
    interval (`source_dist_interval`, `frequency`) are listed in `intervals`. `blocked_test_off` and `two_ways` are what
    the scenario does to the criteria while it runs (Bench2Drive `scenario_runner/srunner/scenarios`).
    """

    name: str
    build: Callable[[Stage], None]
    sites: tuple[Site, ...]
    parameters: dict[str, Metres]
    intervals: dict[str, Metres]
    blocked_test_off: bool
    two_ways: bool


def sites(
    *rows: tuple[str, str, Metres],
    trigger_m: Metres = (4.0, 14.0),
    before_m: Metres | None = None,
) -> tuple[Site, ...]:
    """Make sites that differ in town style, chain of lanes and length of the route only."""
    return tuple(
        Site(style, chain, length_m, trigger_m=trigger_m, before_m=before_m) for style, chain, length_m in rows
    )


SCENARIOS: dict[str, ScenarioType] = {}
"""Every scenario type by its name in the route XML."""


def scenario(
    name: str,
    *,
    sites: tuple[Site, ...],
    parameters: dict[str, Metres] | None = None,
    intervals: dict[str, Metres] | None = None,
    flow: tuple[Metres, Metres] | None = None,
    blocked_test_off: bool = False,
    two_ways: bool = False,
) -> Callable[[Callable[[Stage], None]], Callable[[Stage], None]]:
    """Register a builder under its name in the route XML.

    `flow` are the speeds (m/s) and the gaps of the flow that the route file describes (`junction_parts.route_flow`).
    """
    drawn = (
        ({"flow_speed": flow[0]}, {"source_dist_interval": flow[1]}) if flow else (parameters or {}, intervals or {})
    )

    def register(build: Callable[[Stage], None]) -> Callable[[Stage], None]:
        SCENARIOS[name] = ScenarioType(name, build, sites, *drawn, blocked_test_off, two_ways)
        return build

    return register
