"""Compares a run with an accepted run: stored runs, blessed baselines, their comparison, and waivers.

`snapshot` holds the scores of a run, read from either kind of file: `document` is a whole run as JSON, `baselines` are
the small reviewed files into which `bless` writes a run. `references` stores runs and finds a run by its name.
`comparison` judges a run against another by `allowance` (what may get worse) and `fingerprint` (whether the runs may be
compared). `waivers` are requirements that may fail until a date.
"""
