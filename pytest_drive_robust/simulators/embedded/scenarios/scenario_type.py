"""Define scenario types: one function each that puts actors on a `Stage`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pytest_drive_robust.arithmetic.random_numbers import Range
from pytest_drive_robust.simulators.embedded.stage import Stage
from pytest_drive_robust.simulators.embedded.state import TWO_WAYS_NEVER


@dataclass(frozen=True, slots=True)
class ScenarioType:
    """One of the 44 situations.

    `parameters` are the ranges from which the generator draws the XML's parameter elements; `intervals` are the ranges
    of elements that hold an interval (`source_dist_interval`, `frequency`). The scenario changes two criteria:
    `blocked_test_off` switches the blocked test off while the scenario runs, and `two_ways` (one of
    `state.TWO_WAYS_*`) allows driving against the traffic (Bench2Drive `scenario_runner/srunner/scenarios`).
    """

    name: str
    build: Callable[[Stage], None]
    parameters: dict[str, Range]
    intervals: dict[str, Range]
    blocked_test_off: bool
    two_ways: int


SCENARIOS: dict[str, ScenarioType] = {}
"""Every scenario type by its name in the route XML."""


def scenario(
    name: str,
    *,
    parameters: dict[str, Range] | None = None,
    intervals: dict[str, Range] | None = None,
    flow: tuple[Range, Range] | None = None,
    blocked_test_off: bool = False,
    two_ways: int = TWO_WAYS_NEVER,
) -> Callable[[Callable[[Stage], None]], Callable[[Stage], None]]:
    """Register a builder under its name in the route XML.

    `flow` are the ranges of speeds (m/s) and gaps (m) of the route file's flow (`parts.route_flow`).
    """
    drawn = (
        ({"flow_speed": flow[0]}, {"source_dist_interval": flow[1]}) if flow else (parameters or {}, intervals or {})
    )

    def register(build: Callable[[Stage], None]) -> Callable[[Stage], None]:
        SCENARIOS[name] = ScenarioType(name, build, *drawn, blocked_test_off, two_ways)
        return build

    return register
