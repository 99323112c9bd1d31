"""Stores of finished episodes: in memory, or in a folder that processes and runs share.

`base` defines the interface of a store, `opening` opens the store that the run options name, and `reuse` says which
stored episodes later runs may use. `folder` is the store on disk, with one checksummed file per episode: `record` is
the content of a file, `episode_fields` its facts, `packing` its tables, `track_bytes` its tracks, `record_files` reads
and writes the files, and `claims` locks the episodes that are being driven. `index` and `maintenance` list and clean a
folder. `events` defines what happens in a run; `journal` passes events between processes. `whole_file` writes all
files of this package.
"""
