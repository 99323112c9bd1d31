"""The code around the networks: the agents' base classes, route planner, controllers, filter, memory.

Only `learned_agent` and `bev_agent` load networks; the other modules compute without torch.
"""
