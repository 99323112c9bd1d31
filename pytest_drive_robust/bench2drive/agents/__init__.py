"""Agents of the CARLA leaderboard on our simulators: `--drive-agent leaderboard:path/to/agent_file.py+path/to/config`.

`factory` is called by the registry, finds the agent's class, and tells what identifies the agent in the store.
`stand_ins` replace CARLA and the leaderboard for the agent's file where these are not installed. `adapter` puts the
agent behind our `Agent` protocol: `official_rig` reads its sensor list, `payloads` and `ray_sensors` make the sensor
data, `opendrive` makes the map, and `carla_world` answers the agent's calls to CARLA.
"""
