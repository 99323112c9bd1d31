"""Is this run worse than one that people accepted? Stored runs, blessed baselines, their comparison, and waivers.

`snapshot` is what a comparison needs of a run, whatever file it comes from: `document` is a whole run as JSON,
`baselines` are the small reviewed files, into which `bless` puts a run. `references` stores runs and finds one by its
name, `comparison` judges one against another by `allowance` (what may get worse) and `fingerprint` (whether they may be
compared at all). `waivers` are requirements that are allowed to fail until a date.
"""
