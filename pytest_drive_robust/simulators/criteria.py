"""The numbers of the leaderboard's criteria, by which each of our worlds judges.

Source: Bench2Drive `scenario_runner/srunner/scenariomanager/scenarioatomics/atomic_criteria.py`; the numbers are
Bench2Drive's. Rows of a route are about a metre apart.
"""

from __future__ import annotations

import math

STANDING_MPS = 0.1
"""Speed below which a body counts as standing."""
BLOCKED_S = 60.0
"""An ego that stands longer ends the episode."""

ROUTE_WINDOW = 3
"""Rows of the route among which progress looks for the ego: the current row and the next two."""
COMPLETE_PCT, COMPLETE_M = 99.0, 10.0
"""A route is completed beyond this share of its length and nearer than this to its end."""
JUNCTION_PASSED_ROWS = 8
"""Rows after the first row in a junction until the junction counts as passed."""

DEVIATION_WINDOW = 6
"""Rows of the route among which the deviation looks for the nearest: the nearest row so far and the next five."""
DEVIATION_M = 30.0
"""Distance from the route that ends the episode."""
DEVIATION_SOFT_M, DEVIATION_SHARE = 15.0, 0.30
"""A larger share of the route that passes farther away than this ends the episode, too."""

OUTSIDE_M = 0.5
"""Distance beyond the edge of the nearest lane from which the ego is outside."""
WRONG_WAY_RAD = math.radians(120.0)
"""Angle between the ego and its lane from which the ego drives against the traffic."""

CHECKPOINTS = 20
"""The ego's speed is compared with the traffic's once for each of so many equal parts of the route."""
LAST_CHECKPOINT_SHARE = 0.95
"""Share of the route beyond which the last part is compared, too."""
