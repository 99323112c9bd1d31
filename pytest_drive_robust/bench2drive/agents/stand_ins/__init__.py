"""Stand-ins for CARLA and the leaderboard, for agent files that import these where they are not installed.

The stand-ins are written from the public interfaces, for agents that need only the base class, the commands and the few
types that both use. CARLA's own names stay (`RoadOption`), because agent files import these names. An installed
package, or one on `sys.path`, always goes first: see `finder`.
"""
