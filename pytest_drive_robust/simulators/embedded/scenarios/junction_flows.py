"""A flow of traffic at a junction that does not stop for the ego: cross it or join it through a gap.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{signalized,non_signalized}_junction_{left,right}_turn.py`,
`cross_bicycle_flow.py`, `actor_flow.py`.
"""

from __future__ import annotations

from pytest_drive_robust.domain.truth import ActorKind, LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.map import follow, join
from pytest_drive_robust.simulators.embedded.scenarios.parts import (
    RED_S,
    end_behind_junction,
    meeting_point,
    route_flow,
)
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import Metres, scenario, sites
from pytest_drive_robust.simulators.embedded.stage import GREEN, RED, Program, Stage, red_then_green

_OWN_RED = red_then_green(RED_S)


def _turn(
    name: str,
    *rows: tuple[str, str, Metres],
    from_arm: str,
    into: str = "straight",
    lights: tuple[Program, Program, Program] | None = None,
    flow: tuple[Metres, Metres],
    given: bool = False,
) -> None:
    """Register a type: the ego turns across or into a flow that comes `from_arm`.

    `rows` are town style, chain and length of the route. `into` says where the flow goes: `"straight"` on, or turning
    into the ego's `"exit"`. `lights` are those of the ego, of the opposite road and of the crossing one; None where
    there are none. `flow` are its speeds (m/s) and gaps. Where `given`, the route file may say from where to where it
    leads.
    """

    def build(stage: Stage) -> None:
        if lights is not None:
            stage.lights(ego=lights[0], opposite=lights[1], crossing=lights[2])
        path = stage.given_flow() if given else None
        if path is None:
            path = stage.from_arm(from_arm, into=into)
        route_flow(stage, path, meets_ahead_m=stage.junction_ahead_m())
        end_behind_junction(stage)

    places = sites(*rows, trigger_m=(3.0, 8.0), before_m=(30.0, 40.0))
    scenario(name, sites=places, flow=flow, blocked_test_off=True)(build)


# Turn left across an oncoming flow; the ego's light is red for five seconds, the flow's is green all the time.
_turn(
    "SignalizedJunctionLeftTurn",
    ("LightCrossing", "E.left0", (75.0, 90.0)),
    ("LightAvenueCrossing", "N.left0", (80.0, 95.0)),
    ("LightTee", "E.left0", (72.0, 88.0)),
    ("Grid", "W1.left0", (70.0, 80.0)),
    from_arm="opposite", lights=(_OWN_RED, GREEN, RED), flow=((9.0, 11.0), (15.0, 28.0)),
)  # fmt: skip
# Turn left and join the oncoming flow that turns right into the same exit; red for five seconds, then green.
_turn(
    "SignalizedJunctionLeftTurnEnterFlow",
    ("LightCrossing", "W.left0", (75.0, 92.0)),
    ("LightTee", "E.left0", (75.0, 90.0)),
    ("Grid", "W1.left0", (70.0, 80.0)),
    from_arm="opposite", into="exit", lights=(_OWN_RED, GREEN, RED), flow=((8.0, 10.0), (15.0, 30.0)),
)  # fmt: skip
# Turn right into a flow from the left, which keeps its green; the ego's light is red for five seconds first.
_turn(
    "SignalizedJunctionRightTurn",
    ("LightCrossing", "N.right0", (68.0, 82.0)),
    ("LightAvenueCrossing", "E.right1", (70.0, 85.0)),
    ("LightTee", "S.right0", (68.0, 82.0)),
    ("Grid", "E0.right0", (66.0, 78.0)),
    from_arm="left", into="exit", lights=(_OWN_RED, _OWN_RED, GREEN), flow=((10.0, 14.0), (19.0, 38.0)),
)  # fmt: skip
# Turn left across an oncoming flow; no light holds it back.
_turn(
    "NonSignalizedJunctionLeftTurn",
    ("OpenCrossing", "S.left0", (72.0, 88.0)),
    ("OpenTee", "E.left0", (72.0, 88.0)),
    ("RuralTee", "E.left0", (78.0, 92.0)),
    from_arm="opposite", flow=((8.0, 11.0), (15.0, 30.0)),
)  # fmt: skip
# Turn left and join the oncoming flow that turns right into the same exit.
_turn(
    "NonSignalizedJunctionLeftTurnEnterFlow",
    ("OpenCrossing", "N.left0", (74.0, 90.0)),
    ("OpenTee", "E.left0", (74.0, 90.0)),
    ("RuralTee", "E.left0", (78.0, 94.0)),
    from_arm="opposite", into="exit", flow=((8.0, 10.0), (15.0, 30.0)),
)  # fmt: skip
# Turn right into a flow that comes from the left; nobody stops for the ego.
_turn(
    "NonSignalizedJunctionRightTurn",
    ("OpenCrossing", "E.right0", (68.0, 82.0)),
    ("OpenTee", "S.right0", (68.0, 82.0)),
    ("OpenCrossing", "W.right0", (68.0, 82.0)),
    ("RuralTee", "S.right0", (70.0, 86.0)),
    from_arm="left", into="exit", flow=((8.0, 14.0), (16.0, 30.0)),
)  # fmt: skip
# Turn into a fast flow from the left, or from where the file says; where there are lights, both have green.
_turn(
    "EnterActorFlow",
    ("RuralTee", "S.right0", (76.0, 92.0)),
    ("RuralCrossing", "N.right0", (76.0, 92.0)),
    ("LightTee", "S.right0", (74.0, 90.0)),
    from_arm="left", into="exit", lights=(GREEN, GREEN, GREEN), given=True, flow=((12.0, 19.0), (17.0, 39.0)),
)  # fmt: skip


@scenario(
    "CrossingBicycleFlow",
    sites=sites(
        ("BikeCrossing", "E.right0", (76.0, 92.0)),
        ("BikeCrossing", "N.left0", (78.0, 94.0)),
        ("BikeCrossing", "S.right0", (76.0, 92.0)),
        trigger_m=(3.0, 8.0),
        before_m=(32.0, 42.0),
    ),
    flow=((8.0, 12.0), (5.0, 30.0)),
    blocked_test_off=True,
)
def crossing_bicycle_flow(stage: Stage) -> None:
    """Turn across a biking lane whose riders go straight on; the ego's light is red for five seconds first."""
    stage.lights(ego=red_then_green(RED_S), opposite=GREEN)
    path = _first_biking_lane(stage)
    route_flow(stage, path, meets_ahead_m=stage.junction_ahead_m(), kinds=(ActorKind.BICYCLE,))
    end_behind_junction(stage)


def _first_biking_lane(stage: Stage) -> int:
    """Return the path of the biking lane that the route crosses first. Raises `RouteError` when it crosses none."""
    lane_map = stage.dense.lane_map
    crossed: list[tuple[float, int]] = []
    for lane in lane_map.lanes:
        if lane.kind is not LaneKind.BIKING or not lane.junction:
            continue
        path = stage.add_path(join(lane_map, follow(lane_map, lane.index)))
        met = meeting_point(stage, path)
        if met is not None:
            crossed.append((met[0], path))
    if not crossed:
        raise RouteError(f"route {stage.dense.route.id}: scenario {stage.spec.type} needs a biking lane to turn across")
    return min(crossed)[1]
