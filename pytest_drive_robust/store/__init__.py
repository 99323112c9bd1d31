"""Where finished episodes live: in memory, or in a folder that processes and runs share.

Where is what: `base` says what a run needs of a store, `folder` keeps that promise with one checksummed file for each
episode (`record` is its content, `packing` its tables, `shelf` the folder of files, `claims` who drives what); `index`
and `care` look after a folder. `events` and `journal`: what happens in a run.
"""
