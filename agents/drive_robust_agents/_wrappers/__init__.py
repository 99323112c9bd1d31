"""What stands around the networks: route planner, controllers, filter. Numbers in, numbers out; no torch."""
