"""Convert the kernels' event rows to the domain's `EpisodeScore`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions
from pytest_drive_robust.simulators.criteria import DEVIATION_SHARE, JUNCTION_PASSED_ROWS
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.state import DT_S
from pytest_drive_robust.simulators.infractions import closing_infractions, collision, end_detail

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.embedded.world import World

ENDS = {
    c.END_COMPLETED: End.COMPLETED,
    c.END_DEVIATED: End.DEVIATED,
    c.END_BLOCKED: End.BLOCKED,
    c.END_TICK_CAP: End.TICK_CAP,
    c.END_STUCK: End.STUCK,
}


def score_of(world: World, options: SimulatorOptions) -> EpisodeScore:
    """Return the score of a finished episode from its criteria."""
    end = ENDS.get(int(world.state.criteria_ints[c.CI_END]), End.SIMULATION_CRASHED)
    passed = float(world.dense.s[world.state.criteria_ints[c.CI_PROGRESS]])
    here = int(world.state.clock[c.TICK]), float(world.state.ego[c.EGO_X]), float(world.state.ego[c.EGO_Y])
    outside, off_route = (float(world.state.criteria[k]) for k in (c.C_OUTSIDE_M, c.C_OFFROUTE_M))
    strayed = off_route > DEVIATION_SHARE * world.dense.length_m
    at_the_end = closing_infractions(end, outside_m=outside, passed_m=passed, strayed=strayed, here=here)
    still_s = float(world.state.criteria[c.C_STILL_S])
    ratios = [row[c.EV_VALUE] for row in world.state.noted() if row[c.EV_KIND] == c.EVENT_SPEED]
    return EpisodeScore(
        end=end,
        end_detail=end_detail(end, at_s=here[0] * DT_S, still_s=still_s, options=options, dt_s=DT_S),
        route_completion_pct=100.0 if end is End.COMPLETED else round(100.0 * passed / world.dense.length_m, 2),
        route_length_m=world.dense.length_m,
        infractions=(*_noted_infractions(world), *at_the_end),
        speed_ratios_pct=tuple(float(ratio) for ratio in ratios),
        junction_passed=_junction_passed(world),
    )


def _noted_infractions(world: World) -> list[Infraction]:
    """Return the infractions that the kernels recorded, in the order of time."""
    found = []
    for row in world.state.noted():
        kind, number, value = int(row[c.EV_KIND]), int(row[c.EV_ACTOR]), float(row[c.EV_VALUE])
        here = int(row[c.EV_TICK]), float(row[c.EV_X]), float(row[c.EV_Y])
        if kind == c.EVENT_COLLISION:
            what = ActorKind.BUILDING if number < 0 else ActorKind(int(world.state.actor_ints[number, c.I_KIND]))
            found.append(collision(what, value, here))
        elif kind == c.EVENT_RED_LIGHT:
            found.append(Infraction(InfractionKind.RED_LIGHT, here[0], "ran a red light", *here[1:]))
        elif kind == c.EVENT_STOP_SIGN:
            detail = f"passed a stop sign at {value:.1f} m/s"
            found.append(Infraction(InfractionKind.STOP_SIGN, here[0], detail, *here[1:]))
        elif kind == c.EVENT_YIELD:
            detail = "did not let the emergency vehicle past"
            found.append(Infraction(InfractionKind.YIELD_EMERGENCY, here[0], detail, *here[1:]))
    return found


def _junction_passed(world: World) -> bool:
    """Return whether the ego passed the route's first junction."""
    row = world.dense.first_junction_row()
    return row is not None and int(world.state.criteria_ints[c.CI_PROGRESS]) > row + JUNCTION_PASSED_ROWS
