"""The compiled tick of the world. Python calls `entry_points`; the other modules are compiled into these functions.

- `world_arrays`: the reference to a world's arrays that kernels pass to each other
- `scenario`: lights, flows and scripts; `paths` and `drivers`: traffic
- `mkz`, `ego`: the vehicle that the agent drives; `contacts`: whom it hits
- `judge`: the criteria, with `lane_keeping` and `lights_and_signs`
"""
