"""The modules of the planner behind the privileged agents `expert` and `reactive`."""
