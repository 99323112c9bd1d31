"""A flow of traffic at a junction that does not stop for the ego: cross it or join it through a gap.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{signalized,non_signalized}_junction_{left,right}_turn.py`,
`cross_bicycle_flow.py`, `actor_flow.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from pytest_drive_robust.simulators.embedded.scenarios.junction_parts import RED_S, end_behind_junction, route_flow
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Site, scenario, sites
from pytest_drive_robust.simulators.embedded.signals import GREEN, RED, Program, red_then_green
from pytest_drive_robust.simulators.embedded.stage import Stage

__all__: list[str] = []

Metres = tuple[float, float]
_OWN_RED = red_then_green(RED_S)
_sites = partial(sites, trigger_m=(3.0, 8.0), before_m=(30.0, 40.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Turn:
    """A turn of the ego across or into a flow that comes `from_arm`.

    `into` says where the flow goes: `"straight"` on, or turning into the ego's `"exit"`. `lights` are those of the ego,
    of the opposite road and of the crossing one; None where there are none. Where `given`, the route file may say from
    where to where the flow leads.
    """

    from_arm: str
    into: str = "straight"
    lights: tuple[Program, Program, Program] | None = None
    speed_mps: Metres
    gap_m: Metres
    given: bool = False
    sites: tuple[Site, ...]

    def build(self, stage: Stage) -> None:
        """Put the lights and the flow on the stage."""
        if self.lights is not None:
            ego, opposite, crossing = self.lights
            stage.lights(ego=ego, opposite=opposite, crossing=crossing)
        path = stage.given_flow() if self.given else None
        if path is None:
            path = stage.from_arm(self.from_arm, into=self.into)
        meets_m = stage.junction_ahead_m()
        route_flow(stage, path, speed_mps=self.speed_mps, gap_m=self.gap_m, meets_ahead_m=meets_m)
        end_behind_junction(stage)


_TURNS = {
    # Turn left across an oncoming flow; the ego's light is red for five seconds, the flow's is green all the time.
    "SignalizedJunctionLeftTurn": _Turn(
        from_arm="opposite",
        lights=(_OWN_RED, GREEN, RED),
        speed_mps=(9.0, 11.0),
        gap_m=(15.0, 28.0),
        sites=_sites(
            ("LightCrossing", "E.left0", (75.0, 90.0)),
            ("LightAvenueCrossing", "N.left0", (80.0, 95.0)),
            ("LightTee", "E.left0", (72.0, 88.0)),
            ("Grid", "W1.left0", (70.0, 80.0)),
        ),
    ),
    # Turn left and join the oncoming flow that turns right into the same exit; red for five seconds, then green.
    "SignalizedJunctionLeftTurnEnterFlow": _Turn(
        from_arm="opposite",
        into="exit",
        lights=(_OWN_RED, GREEN, RED),
        speed_mps=(8.0, 10.0),
        gap_m=(15.0, 30.0),
        sites=_sites(
            ("LightCrossing", "W.left0", (75.0, 92.0)),
            ("LightTee", "E.left0", (75.0, 90.0)),
            ("Grid", "W1.left0", (70.0, 80.0)),
        ),
    ),
    # Turn right into a flow from the left, which keeps its green; the ego's light is red for five seconds first.
    "SignalizedJunctionRightTurn": _Turn(
        from_arm="left",
        into="exit",
        lights=(_OWN_RED, _OWN_RED, GREEN),
        speed_mps=(10.0, 14.0),
        gap_m=(19.0, 38.0),
        sites=_sites(
            ("LightCrossing", "N.right0", (68.0, 82.0)),
            ("LightAvenueCrossing", "E.right1", (70.0, 85.0)),
            ("LightTee", "S.right0", (68.0, 82.0)),
            ("Grid", "E0.right0", (66.0, 78.0)),
        ),
    ),
    # Turn left across an oncoming flow; no light holds it back.
    "NonSignalizedJunctionLeftTurn": _Turn(
        from_arm="opposite",
        speed_mps=(8.0, 11.0),
        gap_m=(15.0, 30.0),
        sites=_sites(
            ("OpenCrossing", "S.left0", (72.0, 88.0)),
            ("OpenTee", "E.left0", (72.0, 88.0)),
            ("RuralTee", "E.left0", (78.0, 92.0)),
        ),
    ),
    # Turn left and join the oncoming flow that turns right into the same exit.
    "NonSignalizedJunctionLeftTurnEnterFlow": _Turn(
        from_arm="opposite",
        into="exit",
        speed_mps=(8.0, 10.0),
        gap_m=(15.0, 30.0),
        sites=_sites(
            ("OpenCrossing", "N.left0", (74.0, 90.0)),
            ("OpenTee", "E.left0", (74.0, 90.0)),
            ("RuralTee", "E.left0", (78.0, 94.0)),
        ),
    ),
    # Turn right into a flow that comes from the left; nobody stops for the ego.
    "NonSignalizedJunctionRightTurn": _Turn(
        from_arm="left",
        into="exit",
        speed_mps=(8.0, 14.0),
        gap_m=(16.0, 30.0),
        sites=_sites(
            ("OpenCrossing", "E.right0", (68.0, 82.0)),
            ("OpenTee", "S.right0", (68.0, 82.0)),
            ("OpenCrossing", "W.right0", (68.0, 82.0)),
            ("RuralTee", "S.right0", (70.0, 86.0)),
        ),
    ),
    # Turn into a fast flow from the left, or from where the file says; where there are lights, both have green.
    "EnterActorFlow": _Turn(
        from_arm="left",
        into="exit",
        lights=(GREEN, GREEN, GREEN),
        given=True,
        speed_mps=(12.0, 19.0),
        gap_m=(17.0, 39.0),
        sites=_sites(
            ("RuralTee", "S.right0", (76.0, 92.0)),
            ("RuralCrossing", "N.right0", (76.0, 92.0)),
            ("LightTee", "S.right0", (74.0, 90.0)),
        ),
    ),
}


for _name, _turn in _TURNS.items():
    scenario(
        _name,
        sites=_turn.sites,
        parameters={"flow_speed": _turn.speed_mps},
        intervals={"source_dist_interval": _turn.gap_m},
        blocked_test_off=True,
    )(_turn.build)
