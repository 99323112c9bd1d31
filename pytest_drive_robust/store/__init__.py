"""Where finished episodes live: in memory, or in a folder that processes and runs share.

`base` says what a run needs of a store, `opening` opens the one that it was given, `reuse` says which episodes count
again. `folder` keeps that promise with one checksummed file for each episode: `record` is its content,
`episode_fields` the facts in it, `packing` its tables, `track_bytes` its tracks, `record_files` the files, `claims` who
drives what. `index` and `maintenance` look after a folder. `events` are what happens in a run, `journal` is how
processes tell each other of it. `whole_file` writes every file of ours.
"""
