"""Bicycles on their own lane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scenario_driver import drawn

from pytest_drive_robust.domain.truth import ActorKind
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
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


def test_bicycles_ride_on_their_own_lane_beside_the_cars() -> None:
    for number in range(len(SCENARIOS["CrossingBicycleFlow"].sites)):
        world = World(drawn("CrossingBicycleFlow", number), seed=0)
        assert {int(k) for m in file_flows(world) for k in world.state.actor_ints[m, c.I_KIND]} == {ActorKind.BICYCLE}
