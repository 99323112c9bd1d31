"""Agents of the CARLA leaderboard on our simulators: `--drive-agent leaderboard:path/to/agent_file.py+path/to/config`.

`factory` is what the registry calls, finds the agent's class, and makes it the same agent for the store; `stand_ins` is
what its file imports where CARLA and the leaderboard are not installed. `adapter` puts the agent behind our `Agent`
protocol: `official_rig` understands its sensors, `payloads` and `ray_sensors` give what they measure, `opendrive` the
map, and `carla_world` is what it may ask CARLA.
"""
