"""The planner behind `expert`, step by step; `reactive` and `blind` use its `control` and `projection`."""
