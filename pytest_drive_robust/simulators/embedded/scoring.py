"""Convert the kernels' event rows to the domain's `EpisodeScore`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.base import EpisodeScore, SimulatorOptions
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.state import DT_S

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.embedded.world import World

ENDS = {
    c.END_COMPLETED: End.COMPLETED,
    c.END_DEVIATED: End.DEVIATED,
    c.END_BLOCKED: End.BLOCKED,
    c.END_TICK_CAP: End.TICK_CAP,
    c.END_STUCK: End.STUCK,
}

COLLISIONS = {
    "vehicle": InfractionKind.COLLISION_VEHICLE,
    "pedestrian": InfractionKind.COLLISION_PEDESTRIAN,
    "layout": InfractionKind.COLLISION_LAYOUT,
}


def score_of(world: World, options: SimulatorOptions) -> EpisodeScore:
    """Return the score of a finished episode from its criteria."""
    end = ENDS.get(int(world.state.criteria_ints[c.CI_END]), End.SIMULATION_CRASHED)
    passed = float(world.dense.s[world.state.criteria_ints[c.CI_PROGRESS]])
    here = int(world.state.clock[0]), float(world.state.ego[c.EGO_X]), float(world.state.ego[c.EGO_Y])
    outside = float(world.state.criteria[c.C_OUTSIDE_M])
    at_the_end = closing_infractions(end, outside_m=outside, passed_m=passed, strayed=_strayed(world), here=here)
    infractions = [*_infractions(world), *at_the_end]
    still_s = float(world.state.criteria[c.C_STILL_S])
    ratios = [row[c.EV_VALUE] for row in world.state.noted() if row[c.EV_KIND] == c.EVENT_SPEED]
    return EpisodeScore(
        end=end,
        end_detail=end_detail(end, at_s=here[0] * DT_S, still_s=still_s, options=options, dt_s=DT_S),
        route_completion_pct=100.0 if end is End.COMPLETED else round(100.0 * passed / world.dense.length_m, 2),
        route_length_m=world.dense.length_m,
        infractions=tuple(infractions),
        speed_ratios_pct=tuple(float(ratio) for ratio in ratios),
        junction_passed=_junction_passed(world),
    )


def _strayed(world: World) -> bool:
    from pytest_drive_robust.simulators.embedded.criteria import DEVIATION_SHARE  # with the world, which loads numba

    return float(world.state.criteria[c.C_OFFROUTE_M]) > DEVIATION_SHARE * world.dense.length_m


def _infractions(world: World) -> list[Infraction]:
    found = []
    for row in world.state.noted():
        kind, number, value = int(row[c.EV_KIND]), int(row[c.EV_ACTOR]), float(row[c.EV_VALUE])
        if kind == c.EVENT_SPEED:
            continue
        if kind == c.EVENT_COLLISION:
            what = ActorKind.BUILDING if number < 0 else ActorKind(int(world.state.actor_ints[number, c.I_KIND]))
            name = what.name.lower().replace("_", " ")
            infraction, detail = COLLISIONS[what.collision_class], f"hit {name} at {value:.1f} m/s"
        elif kind == c.EVENT_RED_LIGHT:
            infraction, detail = InfractionKind.RED_LIGHT, "ran a red light"
        elif kind == c.EVENT_STOP_SIGN:
            infraction, detail = InfractionKind.STOP_SIGN, f"passed a stop sign at {value:.1f} m/s"
        else:
            infraction, detail = InfractionKind.YIELD_EMERGENCY, "did not let the emergency vehicle past"
        found.append(Infraction(infraction, int(row[c.EV_TICK]), detail, float(row[c.EV_X]), float(row[c.EV_Y])))
    return found


def closing_infractions(
    end: End, *, outside_m: float, passed_m: float, strayed: bool, here: tuple[int, float, float]
) -> list[Infraction]:
    """Return the infractions that are known only at the end, at the tick and place `here` (x, y in metres).

    `outside_m` of the `passed_m` metres of the route were driven outside its lanes. `strayed`: the share of the route
    that was driven far from the route is large enough to end the episode by itself.
    """
    tick, x, y = here
    found = []
    if end is End.DEVIATED:
        detail = (
            "went more than 15 m from the route for more than 30 % of it"
            if strayed
            else "left the route by more than 30 m"
        )
        found.append(Infraction(InfractionKind.DEVIATION, tick, detail, x, y))
    if end is End.BLOCKED:
        found.append(Infraction(InfractionKind.BLOCKED, tick, "stood still for more than 60 s", x, y))
    if outside_m > 0.0 and passed_m > 0.0:
        share = 100.0 * outside_m / passed_m
        detail = f"outside its lanes for {outside_m:.0f} m, {share:.0f} % of the way"
        found.append(Infraction(InfractionKind.OUTSIDE_LANES, tick, detail, x, y, share))
    return found


def end_detail(
    end: End, *, at_s: float, still_s: float, options: SimulatorOptions, dt_s: float, stopped: str = ""
) -> str:
    """Return a phrase why an episode ended after `at_s` seconds, of which the last `still_s` were at rest.

    `stopped` is the environment's reason to end the episode.
    """
    return {
        End.COMPLETED: f"reached the end at {at_s:.1f} s",
        End.DEVIATED: f"left the route at {at_s:.1f} s",
        End.ENVIRONMENT: f"the environment ended the episode at {at_s:.1f} s: {stopped}",
        End.BLOCKED: f"stood still for {still_s:.0f} s",
        End.TICK_CAP: f"not finished after {options.tick_cap} ticks ({options.tick_cap * dt_s:.0f} s)",
        End.STUCK: f"stood still for {still_s:.0f} s, stopped early (--drive-stuck-stop)",
    }.get(end, f"stopped at {at_s:.1f} s before any end was reached")


def _junction_passed(world: World) -> bool:
    """Return whether the ego passed more than eight waypoints after the route's first waypoint in a junction."""
    row = world.dense.first_junction_row()
    return row is not None and int(world.state.criteria_ints[c.CI_PROGRESS]) > row + 8
