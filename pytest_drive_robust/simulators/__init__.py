"""The worlds that an agent can be driven in: a folder per backend behind `base.Simulator`.

`criteria` has the numbers and `infractions` the sentences by which our worlds judge. `routes` finds the routes that
`--drive-routes` names. Importing `gymnasium_ids` registers the default world as a gymnasium environment.
"""
