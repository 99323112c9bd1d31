"""A chapter for each scenario type of the embedded world."""

from __future__ import annotations

import inspect
from collections.abc import Mapping

from pytest_drive_robust.metrics.ability import ABILITIES
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
from pytest_drive_robust.simulators.routes import resolve_routes
from reference_parts.rst import heading

_PASS = "stands in the lane. Change to the lane on the left, which is in use."
_BORROW = "stands in the lane. Drive around it through a gap of the oncoming traffic."
_SHARED: Mapping[str, str] = {
    "Accident": f"A police car with two crashed cars behind it {_PASS}",
    "AccidentTwoWays": f"A police car with two crashed cars behind it {_BORROW}",
    "ConstructionObstacle": f"A building site with sign, cones and barrier {_PASS}",
    "ConstructionObstacleTwoWays": f"A building site with sign, cones and barrier {_BORROW}",
    "HighwayExit": "Leave a motorway through a flow in the exit lane that stays slower than the road.",
    "InterurbanActorFlow": "Turn left off a country road, across an oncoming flow.",
    "InterurbanAdvancedActorFlow": "Turn left onto a country road, across one flow and into another.",
    "MergerIntoSlowTraffic": "Merge from a ramp into traffic that crawls.",
    "MergerIntoSlowTrafficV2": "Merge into the slow traffic of a lane that is only for the exit.",
    "ParkedObstacle": f"A badly parked car, hazard lights on, {_PASS}",
    "ParkedObstacleTwoWays": f"A badly parked car, hazard lights on, {_BORROW}",
    "SignalizedJunctionLeftTurn": (
        "Turn left across an oncoming flow that has green; the ego's light is red for five seconds first."
    ),
    "SignalizedJunctionLeftTurnEnterFlow": (
        "Turn left and join the oncoming flow that turns right into the same exit; red for five seconds, then green."
    ),
    "SignalizedJunctionRightTurn": (
        "Turn right into a flow from the left, which keeps its green; the ego's light is red for five seconds first."
    ),
    "NonSignalizedJunctionLeftTurn": "Turn left across an oncoming flow; no light holds it back.",
    "NonSignalizedJunctionLeftTurnEnterFlow": (
        "Turn left and join the oncoming flow that turns right into the same exit."
    ),
    "NonSignalizedJunctionRightTurn": "Turn right into a flow that comes from the left; nobody stops for the ego.",
    "EnterActorFlow": "Turn into a fast flow from the left; where there are lights, both have green.",
}
"""What happens where several types share the function that builds them, so that its docstring tells of none."""


def scenarios() -> str:
    """Return a chapter for each scenario type: a picture, what happens, parameters, routes."""
    routes: dict[str, list[str]] = {}
    for route in resolve_routes("full"):
        routes.setdefault(route.scenario.type, []).append(route.id)
    lines: list[str] = []
    for name in sorted(SCENARIOS):
        kind = SCENARIOS[name]
        lines += [f".. _scenario-{name.lower()}:", "", *heading(name, "-"), ""]
        lines += [
            f".. image:: /pictures/scenarios/{name}.webp",
            f"   :alt: {name} from above, and by a front camera",
            "",
        ]
        lines += [_SHARED.get(name) or inspect.getdoc(kind.build) or "", ""]
        drawn = {**kind.parameters, **kind.intervals}
        told = ", ".join(f"``{key}`` {_between(low, high)}" for key, (low, high) in drawn.items())
        abilities = ", ".join(ability for ability, types in ABILITIES.items() if name in types) or "none"
        lines += [
            f":Routes: {', '.join(routes[name])}",
            f":Drawn parameters: {told or 'none'}",
            f":Abilities: {abilities}",
            "",
        ]
    return "\n".join(lines)


def _between(low: float, high: float) -> str:
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
