"""What an agent file imports of CARLA and of the leaderboard, for where these are not installed.

Written from their public interfaces, for agents that need nothing but the base class, the commands and the few types
that these pass around. They keep CARLA's own names (`RoadOption`), because agent files import them by these. What is
installed, or lies on `sys.path`, always goes first: see `finder`.
"""
