"""What stands around the networks: route planner, controllers, filter, memory. Numbers in, numbers out; no torch."""
