"""On motorways and country roads."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scenario_driver import staged

from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.world import World


def file_flows(world: World) -> list[NDArray[np.int64]]:
    """The actors of each flow that the route file asks for, from the first on its way to the last."""
    found = []
    for flow in np.unique(world.state.actor_ints[:, c.I_FLOW]):
        members = np.flatnonzero(
            (world.state.actor_ints[:, c.I_FLOW] == flow)
            & (world.state.actor_ints[:, c.I_BACKGROUND] == 0)
            & (world.state.actor_ints[:, c.I_ACTIVE] == 1)
        )
        if flow >= 0 and len(members):
            found.append(members[np.argsort(-world.state.actors[members, c.A_S])])
    return found


def test_two_flows_meet_who_turns_left_onto_a_country_road() -> None:
    world = staged("InterurbanAdvancedActorFlow")
    first, second = file_flows(world)
    yaws = [float(world.state.actors[members[0], c.A_YAW]) for members in (first, second)]
    assert math.cos(yaws[0] - yaws[1]) == pytest.approx(-1.0, abs=0.05)
