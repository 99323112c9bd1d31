"""What stands around the networks: the agents' bases, route planner, controllers, filter, memory.

Only `learned_agent` and `bev_agent` load networks; the others turn numbers into numbers, without torch.
"""
