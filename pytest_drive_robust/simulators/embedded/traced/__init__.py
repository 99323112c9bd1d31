"""Roads around the routes of the CARLA leaderboard, which name a town of CARLA's and dense waypoints in it.

The towns themselves are CARLA's. A route tells enough to build a plausible stretch of road: its geometry, where its
waypoints leave out a junction, and what its scenario type needs (`schema`).
"""
