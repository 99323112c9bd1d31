"""The arrays that the kernels work on, and the names of their columns. A body is a vehicle or an object of the road."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Arrays"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# --- lanes: one row of floats and one of ints ---
L_X, L_Y, L_ALONG_X, L_ALONG_Y, L_RIGHT_X, L_RIGHT_Y, L_HEADING = range(7)  # circles: L_X, L_Y is the centre
L_RADIUS, L_START_PHASE, L_TURN, L_AMPLITUDE, L_PULSATION, L_PHASE = range(7, 13)
L_LENGTH, L_WIDTH, L_SPEED_LIMIT, L_MARGIN = range(13, 17)  # L_SPEED_LIMIT: nan without; L_MARGIN: VEHICLE_LENGTH
LANE_FLOATS = 17
LI_KIND, LI_EDGE, LI_ID, LI_FORBIDDEN = range(4)
LANE_INTS = 4
STRAIGHT, SINE, CIRCLE = range(3)

# --- edges of the graph: lanes FIRST to FIRST + COUNT - 1 lead from node FROM to node TO ---
E_FROM, E_TO, E_FIRST, E_COUNT = range(4)
EDGE_INTS = 4
# --- nodes: the edges that leave it follow each other; the edges that enter it are listed in `entering` ---
N_LEAVING, N_LEAVING_COUNT, N_ENTERING, N_ENTERING_COUNT = range(4)
NODE_INTS = 4

# --- bodies: state ---
B_X, B_Y, B_HEADING, B_SPEED, B_COS, B_SIN, B_ACCELERATION, B_STEERING = range(8)
B_TIMER, B_TARGET_SPEED, B_IMPACT_X, B_IMPACT_Y = range(8, 12)
BODY_FLOATS = 12
I_KIND, I_LANE, I_TARGET_LANE, I_CRASHED, I_HIT, I_HAS_IMPACT = range(6)
I_CHANGES_LANE, I_SOLID, I_COLLIDABLE, I_CHECKS, I_ROUTE, I_SPEED_INDEX, I_FIRST_SPEED, I_SPEEDS = range(6, 14)
BODY_INTS = 14
# what a body is; everything from CONTROLLED on has a target lane
LANDMARK, OBSTACLE, PLAIN, CONTROLLED, MDP, IDM, LINEAR = range(7)

# --- bodies: parameters ---
P_LENGTH, P_WIDTH, P_DIAGONAL, P_MAX_SPEED, P_MIN_SPEED = range(5)
P_TAU_PURSUIT, P_KP_A, P_KP_HEADING, P_KP_LATERAL, P_MAX_STEERING, P_DELTA_SPEED = range(5, 11)
P_ACC_MAX, P_COMFORT_ACC_MAX, P_COMFORT_ACC_MIN, P_DISTANCE_WANTED, P_TIME_WANTED, P_DELTA = range(11, 17)
P_POLITENESS, P_MIN_GAIN, P_MAX_BRAKING_IMPOSED, P_CHANGE_DELAY, P_SQUARE = range(17, 22)
P_ACCELERATION = 22  # three weights
P_STEERING = 25  # two weights
BODY_PARAMETERS = 27

# --- routes: rows R_EDGE, R_ID of `route_steps`; `route_spans` says which of them are still ahead ---
R_EDGE, R_ID = range(2)
NO_ID = -1

# --- what the ego is told before a tick ---
TOLD_NOTHING, TOLD_CONTROL, TOLD_IDLE, TOLD_FASTER, TOLD_SLOWER, TOLD_LEFT, TOLD_RIGHT = range(7)


class Arrays(NamedTuple):
    """A road with everything on it. L lanes, N bodies (V vehicles first, then the objects)."""

    machine: Ints
    connected: int  # 1: neighbours are searched on connected lanes too ("-v1", "-v2")
    lanes: Floats  # (L, LANE_FLOATS)
    lane_ints: Ints  # (L, LANE_INTS)
    edges: Ints  # (E, EDGE_INTS)
    nodes: Ints  # (nodes, NODE_INTS)
    entering: Ints  # (E,)
    vehicle_count: int  # V
    bodies: Floats  # (N, BODY_FLOATS)
    body_ints: Ints  # (N, BODY_INTS)
    parameters: Floats  # (N, BODY_PARAMETERS)
    route_steps: Ints  # (steps of all routes, 2)
    route_spans: Ints  # (routes, 2): first step ahead, end
    target_speeds: Floats  # target speeds of all MDP vehicles
    along: Floats  # (L, N): longitudinal lane coordinate of each body [m]; nan: not computed yet
    across: Floats  # (L, N): lateral lane coordinate [m]
    search_lanes: Ints  # (2 E + 1,): scratch of the neighbour search
    search_offsets: Floats  # (2 E + 1,)
