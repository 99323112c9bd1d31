"""The compiled entry points: what Python calls to build, advance and read a world.

Semantics are our own (highway-env's are not those of a judge): speed never becomes negative, gaps run from bumper to
bumper with real lengths, contact is the overlap of two boxes at the end of the tick, and it stops bodies instead of
moving them. Everything is a plain loop over `state.State`; the same inputs give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain import truth
from pytest_drive_robust.simulators.embedded import criteria, events, jit, kernels
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.jit import entry, inner, sources_digest
from pytest_drive_robust.simulators.embedded.kernels import flows
from pytest_drive_robust.simulators.embedded.kernels.contacts import contacts
from pytest_drive_robust.simulators.embedded.kernels.drivers import move_actors
from pytest_drive_robust.simulators.embedded.kernels.ego import move_ego
from pytest_drive_robust.simulators.embedded.kernels.lights import set_lights
from pytest_drive_robust.simulators.embedded.kernels.path_survey import survey
from pytest_drive_robust.simulators.embedded.kernels.paths import path_pose
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays, world_arrays
from pytest_drive_robust.simulators.embedded.state import State, Statics

__all__ = ["actor_rows", "finish", "pack_world", "settle", "tick"]

Floats = NDArray[np.float64]


@inner
def _pose_actors(statics: Statics, state: State) -> None:
    """Put every actor where its path coordinates say."""
    for i in range(len(state.actors)):
        whole, actor = state.actor_ints[i], state.actors[i]
        if whole[c.I_PATH] >= 0:
            path = whole[c.I_PATH]
            first, last, step = statics.path_start[path], statics.path_start[path + 1], statics.path_step[path]
            x, y, yaw = path_pose(statics.paths, first, last, step, actor[c.A_S], actor[c.A_LAT])
            actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = x, y, yaw + actor[c.A_TURNED]


def _pack_world(sources: int) -> Callable[[Statics, State], WorldArrays]:
    @entry
    def pack_world(statics: Statics, state: State) -> WorldArrays:
        _ = sources  # part of the cache's key
        return world_arrays(statics, state)

    return pack_world


def _tick(sources: int) -> Callable[[WorldArrays, float, float, float], None]:
    @entry
    def tick(world: WorldArrays, throttle: float, steer: float, brake: float) -> None:
        _ = sources
        statics, state = world.statics, world.state
        state.clock[0] += 1
        set_lights(statics, state)
        flows.run_flows(statics, state)
        survey(statics, state)
        move_actors(statics, state)
        move_ego(statics, state, throttle, steer, brake)
        contacts(statics, state)
        criteria.judge(statics, state)

    return tick


def _settle(sources: int) -> Callable[[WorldArrays], None]:
    @entry
    def settle(world: WorldArrays) -> None:
        _ = sources
        statics, state = world.statics, world.state
        set_lights(statics, state)
        _pose_actors(statics, state)
        flows.fill_flows(statics, state)

    return settle


def _finish(sources: int) -> Callable[[WorldArrays], None]:
    @entry
    def finish(world: WorldArrays) -> None:
        _ = sources
        criteria.finish(world.statics, world.state)

    return finish


def _actor_rows(sources: int) -> Callable[[WorldArrays, Floats], int]:
    @entry
    def actor_rows(world: WorldArrays, rows: Floats) -> int:
        _ = sources
        state = world.state
        count = 0
        for i in range(len(state.actors)):
            if state.actor_ints[i, c.I_ACTIVE] != 1:
                continue
            actor, row = state.actors[i], rows[count]
            row[0], row[1] = i, state.actor_ints[i, c.I_KIND]
            row[2], row[3], row[4], row[5] = actor[c.A_X], actor[c.A_Y], actor[c.A_YAW], actor[c.A_V]
            row[6], row[7], row[8] = actor[c.A_LENGTH], actor[c.A_WIDTH], actor[c.A_HEIGHT]
            row[9] = state.actor_ints[i, c.I_STATE]
            count += 1
        return count

    return actor_rows


_SOURCES = sources_digest(jit, kernels, criteria, events, c, truth)

pack_world = _pack_world(_SOURCES)
"""What the other entry points take: a world by its arrays, which it keeps alive and does not copy."""

tick = _tick(_SOURCES)
"""One tick: time, lights, traffic, ego, contact, criteria."""

settle = _settle(_SOURCES)
"""Put every actor where its path coordinates say and fill the flows; once, after the world was built."""

finish = _finish(_SOURCES)
"""Close the criteria; once per episode."""

actor_rows = _actor_rows(_SOURCES)
"""Write the actors that exist now into `rows` (columns of `Frame.actors`); the number of rows written."""
