"""The list of what went wrong in an episode, written by the kernels."""

from __future__ import annotations

from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.jit import inner
from pytest_drive_robust.simulators.embedded.state import State

__all__ = ["note"]


@inner
def note(state: State, kind: int, actor: float, value: float) -> None:
    """Append one event with the tick and the place of the ego; beyond `EVENT_CAPACITY` events are dropped."""
    count = state.criteria_ints[c.CI_EVENTS]
    if count < len(state.events):
        row = state.events[count]
        row[c.EV_KIND], row[c.EV_TICK], row[c.EV_ACTOR], row[c.EV_VALUE] = kind, state.clock[0], actor, value
        row[c.EV_X], row[c.EV_Y] = state.ego[c.EGO_X], state.ego[c.EGO_Y]
        state.criteria_ints[c.CI_EVENTS] = count + 1
