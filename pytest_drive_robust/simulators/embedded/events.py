"""The list of what went wrong in an episode, written by the kernels."""

from __future__ import annotations

from pytest_drive_robust.jit.kernels import inner
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays

__all__ = ["note"]


@inner
def note(world: WorldArrays, kind: int, actor: float, value: float) -> None:
    """Append one event with the tick and the place of the ego; beyond `EVENT_CAPACITY` events are dropped."""
    count = world.criteria_ints[c.CI_EVENTS]
    if count < len(world.events):
        row = world.events[count]
        row[c.EV_KIND], row[c.EV_TICK], row[c.EV_ACTOR], row[c.EV_VALUE] = kind, world.clock[0], actor, value
        row[c.EV_X], row[c.EV_Y] = world.ego[c.EGO_X], world.ego[c.EGO_Y]
        world.criteria_ints[c.CI_EVENTS] = count + 1
