"""A flow of traffic at a junction that does not stop for the ego: cross it or join it through a gap.

Sources: Bench2Drive `scenario_runner/srunner/scenarios/{signalized,non_signalized}_junction_{left,right}_turn.py`,
`cross_bicycle_flow.py`, `actor_flow.py`.
"""

from __future__ import annotations

from pytest_drive_robust.arithmetic.random_numbers import Range
from pytest_drive_robust.domain.truth import ActorKind, LaneKind
from pytest_drive_robust.errors import RouteError
from pytest_drive_robust.simulators.embedded.light_programs import GREEN, RED, Program, red_then_green
from pytest_drive_robust.simulators.embedded.map import follow, join
from pytest_drive_robust.simulators.embedded.scenarios import parts
from pytest_drive_robust.simulators.embedded.scenarios.scenario_type import scenario
from pytest_drive_robust.simulators.embedded.stage import Stage

_OWN_RED = red_then_green(parts.RED_S)


def _turn(
    name: str,
    *,
    from_arm: str,
    into: str = "straight",
    lights: tuple[Program, Program, Program] | None = None,
    flow: tuple[Range, Range],
    given: bool = False,
) -> None:
    """Register a type: the ego turns across or into a flow that comes `from_arm`.

    `into` says where the flow goes: `"straight"` on, or turning into the ego's `"exit"`. `lights` are the programs for
    the ego, the opposite road and the crossing road; None without lights. `flow` are the ranges of its speeds (m/s) and
    gaps (m). With `given`, the route file may give the start and the end of the flow.
    """

    def build(stage: Stage) -> None:
        if lights is not None:
            stage.lights(ego=lights[0], opposite=lights[1], crossing=lights[2])
        path = stage.given_flow() if given else None
        if path is None:
            path = stage.from_arm(from_arm, into=into)
        parts.route_flow(stage, path, meets_ahead_m=stage.junction_ahead_m())
        parts.end_behind_junction(stage)

    scenario(name, flow=flow, blocked_test_off=True)(build)


# Turn left across an oncoming flow; the ego's light is red for five seconds, the flow's is green all the time.
_turn(
    "SignalizedJunctionLeftTurn", from_arm="opposite", lights=(_OWN_RED, GREEN, RED), flow=((9.0, 11.0), (15.0, 28.0))
)
# Turn left and join the oncoming flow that turns right into the same exit; red for five seconds, then green.
_turn(
    "SignalizedJunctionLeftTurnEnterFlow",
    from_arm="opposite",
    into="exit",
    lights=(_OWN_RED, GREEN, RED),
    flow=((8.0, 10.0), (15.0, 30.0)),
)
# Turn right into a flow from the left, which keeps its green; the ego's light is red for five seconds first.
_turn(
    "SignalizedJunctionRightTurn",
    from_arm="left",
    into="exit",
    lights=(_OWN_RED, _OWN_RED, GREEN),
    flow=((10.0, 14.0), (19.0, 38.0)),
)
# Turn left across an oncoming flow; no light holds it back.
_turn("NonSignalizedJunctionLeftTurn", from_arm="opposite", flow=((8.0, 11.0), (15.0, 30.0)))
# Turn left and join the oncoming flow that turns right into the same exit.
_turn("NonSignalizedJunctionLeftTurnEnterFlow", from_arm="opposite", into="exit", flow=((8.0, 10.0), (15.0, 30.0)))
# Turn right into a flow that comes from the left; nobody stops for the ego.
_turn("NonSignalizedJunctionRightTurn", from_arm="left", into="exit", flow=((8.0, 14.0), (16.0, 30.0)))
# Turn into a fast flow from the left, or from where the file says; where there are lights, both have green.
_turn(
    "EnterActorFlow",
    from_arm="left",
    into="exit",
    lights=(GREEN, GREEN, GREEN),
    given=True,
    flow=((12.0, 19.0), (17.0, 39.0)),
)


@scenario("CrossingBicycleFlow", flow=((8.0, 12.0), (5.0, 30.0)), blocked_test_off=True)
def crossing_bicycle_flow(stage: Stage) -> None:
    """Turn across a biking lane whose riders go straight on; the ego's light is red for five seconds first."""
    stage.lights(ego=_OWN_RED, opposite=GREEN)
    path = _first_biking_lane(stage)
    parts.route_flow(stage, path, meets_ahead_m=stage.junction_ahead_m(), kinds=(ActorKind.BICYCLE,))
    parts.end_behind_junction(stage)


def _first_biking_lane(stage: Stage) -> int:
    """Return the path of the biking lane that the route crosses first. Raises `RouteError` when it crosses none."""
    lane_map = stage.dense.lane_map
    crossed: list[tuple[float, int]] = []
    for lane in lane_map.lanes:
        if lane.kind is not LaneKind.BIKING or not lane.junction:
            continue
        path = stage.add_path(join(lane_map, follow(lane_map, lane.index)))
        met = parts.meeting_point(stage, path)
        if met is not None:
            crossed.append((met[0], path))
    if not crossed:
        raise RouteError(f"route {stage.dense.route.id}: scenario {stage.spec.type} needs a biking lane to turn across")
    return min(crossed)[1]
