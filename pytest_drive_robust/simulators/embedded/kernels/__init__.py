"""The compiled tick of the world. Python calls `entry_points`; the other modules are compiled into these functions."""
