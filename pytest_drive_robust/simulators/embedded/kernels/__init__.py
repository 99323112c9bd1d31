"""The tick of the world, compiled. Python calls `entry_points`; the other modules are compiled into them."""
