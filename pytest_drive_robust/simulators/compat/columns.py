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
LI_KIND, LI_EDGE, LI_ID, LI_FORBIDDEN, LI_SEARCH, LI_SEARCH_END = range(6)
LANE_INTS = 6
STRAIGHT, SINE, CIRCLE = range(3)

# --- edges of the graph: lanes FIRST to FIRST + COUNT - 1 lead from node FROM to node TO, where NEXT_COUNT edges go on,
# of which NEXT is the first ---
E_FROM, E_TO, E_FIRST, E_COUNT, E_NEXT, E_NEXT_COUNT = range(6)
EDGE_INTS = 6

# --- lanes on which neighbours are searched, and how far [m] their coordinate is ahead of the first one's; each lane's
# part of the list begins with itself ---
S_LANE, S_OFFSET = range(2)
SEARCH_FLOATS = 2

# --- bodies: state ---
B_X, B_Y, B_HEADING, B_SPEED, B_COS, B_SIN, B_ACCELERATION, B_STEERING = range(8)
B_TIMER, B_TARGET_SPEED, B_IMPACT_X, B_IMPACT_Y = range(8, 12)
I_KIND, I_LANE, I_TARGET_LANE, I_CRASHED, I_HIT, I_HAS_IMPACT = range(6)
I_CHANGES_LANE, I_SOLID, I_COLLIDABLE, I_CHECKS, I_ROUTE, I_SPEED_INDEX = range(6, 12)
BODY_INTS = 12
# what a body is; everything from CONTROLLED on has a target lane
LANDMARK, OBSTACLE, PLAIN, CONTROLLED, MDP, IDM, LINEAR = range(7)

# --- bodies: parameters, in the columns after the state ---
P_LENGTH, P_WIDTH, P_DIAGONAL, P_MAX_SPEED, P_MIN_SPEED = range(12, 17)
P_TAU_PURSUIT, P_KP_A, P_KP_HEADING, P_KP_LATERAL, P_MAX_STEERING, P_DELTA_SPEED = range(17, 23)
P_ACC_MAX, P_COMFORT_ACC_MAX, P_COMFORT_ACC_MIN, P_DISTANCE_WANTED, P_TIME_WANTED, P_DELTA = range(23, 29)
P_POLITENESS, P_MIN_GAIN, P_MAX_BRAKING_IMPOSED, P_CHANGE_DELAY, P_SQUARE = range(29, 34)
P_ACCELERATION = 34  # three weights
P_STEERING = 37  # two weights
BODY_FLOATS = 39

# --- routes: one row for each (first step ahead, end), then the rows of their steps (edge, id) ---
R_FIRST, R_END = range(2)
R_EDGE, R_ID = range(2)
NO_ID = -1

# --- what a controlled ego is told before a tick ---
TOLD_IDLE, TOLD_FASTER, TOLD_SLOWER, TOLD_LEFT, TOLD_RIGHT = range(5)

ALONG, ACROSS = range(2)


class Arrays(NamedTuple):
    """A road with everything on it: L lanes, E edges, N bodies (vehicles first, then the objects).

    Few and wide on purpose: every function of the kernels is handed all of them.
    """

    machine: Ints  # see `arithmetic`
    lanes: Floats  # (L, LANE_FLOATS)
    lane_ints: Ints  # (L, LANE_INTS)
    edges: Ints  # (E, EDGE_INTS)
    search: Floats  # (lanes of all searches, SEARCH_FLOATS)
    bodies: Floats  # (N, BODY_FLOATS)
    body_ints: Ints  # (N, BODY_INTS)
    routes: Ints  # (routes + steps of all routes, 2)
    coordinates: Floats  # (2, L, N): lane coordinates of each body [m]; ALONG is nan while nobody has asked for it
