"""The compiled entry points, by which Python builds, advances and reads a world.

The rules are our own, because highway-env's are too loose to judge by: speed never becomes negative, gaps run from
bumper to bumper with real lengths, and a contact is the overlap of two boxes at the end of the tick, which stops bodies
instead of moving them. The code is plain loops over `state.State`; equal inputs give equal bits.
"""

from __future__ import annotations

from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.jit.arrays import Floats2
from pytest_drive_robust.jit.kernels import entry
from pytest_drive_robust.simulators.embedded import state as c
from pytest_drive_robust.simulators.embedded.kernels.contacts import contacts, hold_back
from pytest_drive_robust.simulators.embedded.kernels.drivers import move_actors
from pytest_drive_robust.simulators.embedded.kernels.ego import move_ego
from pytest_drive_robust.simulators.embedded.kernels.judge import close, judge
from pytest_drive_robust.simulators.embedded.kernels.mkz import mkz_turn
from pytest_drive_robust.simulators.embedded.kernels.paths import path_pose, survey
from pytest_drive_robust.simulators.embedded.kernels.scenario import fill_flows, run_flows, set_lights
from pytest_drive_robust.simulators.embedded.kernels.world_arrays import WorldArrays, world_arrays
from pytest_drive_robust.simulators.embedded.state import State, Statics

_ID, _KIND, _STATE = WorldState.ID, WorldState.KIND, WorldState.STATE
_X, _Y, _YAW, _SPEED = WorldState.X, WorldState.Y, WorldState.YAW, WorldState.SPEED
_LENGTH, _WIDTH, _HEIGHT = WorldState.LENGTH, WorldState.WIDTH, WorldState.HEIGHT


@entry
def pack_world(statics: Statics, state: State) -> WorldArrays:
    """Return a reference to a world's arrays for the other entry points; the arrays are kept alive, not copied."""
    return world_arrays(statics, state)


@entry
def tick(world: WorldArrays, throttle: float, steer: float, brake: float) -> None:
    """Advance by one tick: time, lights, traffic, ego, contacts, criteria."""
    world.clock[c.TICK] += 1
    set_lights(world)
    run_flows(world)
    survey(world)
    move_actors(world)
    before_mps = world.ego[c.EGO_V]
    move_ego(world, throttle, steer, brake)
    hold_back(world, before_mps)
    contacts(world)
    world.ego[c.EGO_FORWARD] = (world.ego[c.EGO_V] - before_mps) / world.dt_s
    judge(world)


@entry
def finish(world: WorldArrays) -> None:
    """Judge the criteria that are known only at the end of the episode."""
    close(world)


@entry
def settle_turn(world: WorldArrays) -> None:
    """Update the ego's lateral acceleration and yaw rate from its speed and wheels, after it was put elsewhere."""
    ego = world.ego
    yaw_rate = mkz_turn(ego[c.EGO_V], ego[c.EGO_STEER])[1]
    ego[c.EGO_RIGHT], ego[c.EGO_YAW_RATE] = ego[c.EGO_V] * yaw_rate, yaw_rate


@entry
def settle(world: WorldArrays) -> None:
    """Place every actor by its path coordinates and fill the flows; called once, after the world was built."""
    set_lights(world)
    for i in range(len(world.actors)):
        whole, actor = world.actor_ints[i], world.actors[i]
        if whole[c.I_PATH] >= 0:
            x, y, yaw = path_pose(world, whole[c.I_PATH], actor[c.A_ALONG_M], actor[c.A_RIGHT_M])
            actor[c.A_X], actor[c.A_Y], actor[c.A_YAW] = x, y, yaw + actor[c.A_TURNED]
    fill_flows(world)


@entry
def actor_rows(world: WorldArrays, rows: Floats2) -> int:
    """Write the actors that exist now into `rows` (as `WorldState.actors`); return the number of rows written."""
    count = 0
    for i in range(len(world.actors)):
        if world.actor_ints[i, c.I_ACTIVE] != c.PRESENT:
            continue
        actor, row = world.actors[i], rows[count]
        row[_ID], row[_KIND], row[_STATE] = i, world.actor_ints[i, c.I_KIND], world.actor_ints[i, c.I_STATE]
        row[_X], row[_Y], row[_YAW], row[_SPEED] = actor[c.A_X], actor[c.A_Y], actor[c.A_YAW], actor[c.A_V]
        row[_LENGTH], row[_WIDTH], row[_HEIGHT] = actor[c.A_LENGTH], actor[c.A_WIDTH], actor[c.A_HEIGHT]
        count += 1
    return count
