"""Agents of the CARLA leaderboard on our simulators: `--drive-agent leaderboard:path/to/agent_file.py+path/to/config`.

============== ====================================================================================================
module         what it holds
============== ====================================================================================================
`reference`    the text after the colon: a file, and what its `setup` is given
`loading`      from a file to the class that its `get_entry_point` names
`stand_ins`    what an agent file imports of CARLA and the leaderboard, for where they are not installed
`official_rig` the list that `sensors()` gives, understood: cameras for the world, the rest for `payloads`
`payloads`     an observation as the leaderboard's `input_data`
`plans`        a plan as `set_global_plan` wants it
`commands`     a `carla.VehicleControl` as our `Control`
`rays`         distances along rays among boxes: `lidar` and `radar`
`opendrive`    the map of a world as OpenDRIVE; `roads` puts its lanes side by side
`carla_world`  what an agent finds that asks CARLA's world about itself and others
`adapter`      an agent of the leaderboard behind our `Agent` protocol
`factory`      what the registry calls, and what makes the agent the same agent for the store
============== ====================================================================================================
"""
