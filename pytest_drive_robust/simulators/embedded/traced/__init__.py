"""Build roads around the routes of the CARLA leaderboard, which name a town of CARLA's and dense waypoints in it.

The towns themselves belong to CARLA and are not built. A route gives enough data for a plausible stretch of road: its
geometry, the gap in its waypoints at a junction, and the needs of its scenario type (`schema`).
"""
