"""The rooms of the planner behind the privileged agents `expert` and `reactive`."""
