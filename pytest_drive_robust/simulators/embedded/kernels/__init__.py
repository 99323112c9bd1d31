"""The world's tick, compiled. `entry` is what Python calls; the other rooms are compiled into it."""
