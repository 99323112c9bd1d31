"""Infractions and ends of episodes in words, the same in each of our worlds."""

from __future__ import annotations

from pytest_drive_robust.domain.outcome import End, Infraction, InfractionKind
from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.criteria import BLOCKED_S, DEVIATION_M, DEVIATION_SHARE, DEVIATION_SOFT_M

_COLLISIONS = {
    "vehicle": InfractionKind.COLLISION_VEHICLE,
    "pedestrian": InfractionKind.COLLISION_PEDESTRIAN,
    "layout": InfractionKind.COLLISION_LAYOUT,
}

Here = tuple[int, float, float]
"""When and where: tick, x and y in metres."""


def collision(kind: ActorKind, speed_mps: float, here: Here) -> Infraction:
    """Return the collision of an ego that drove at `speed_mps` with an actor."""
    name = kind.name.lower().replace("_", " ")
    return Infraction(_COLLISIONS[kind.collision_class], here[0], f"hit {name} at {speed_mps:.1f} m/s", *here[1:])


def closing_infractions(end: End, *, outside_m: float, passed_m: float, strayed: bool, here: Here) -> list[Infraction]:
    """Return the infractions that are known only at the end.

    `outside_m` of the `passed_m` metres of the route were driven outside its lanes. `strayed`: the share of the route
    that was driven far from the route is large enough to end the episode by itself.
    """
    tick, x, y = here
    found = []
    if end is End.DEVIATED:
        detail = f"left the route by more than {DEVIATION_M:.0f} m"
        if strayed:
            share = 100.0 * DEVIATION_SHARE
            detail = f"went more than {DEVIATION_SOFT_M:.0f} m from the route for more than {share:.0f} % of it"
        found.append(Infraction(InfractionKind.DEVIATION, tick, detail, x, y))
    if end is End.BLOCKED:
        found.append(Infraction(InfractionKind.BLOCKED, tick, f"stood still for more than {BLOCKED_S:.0f} s", x, y))
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
