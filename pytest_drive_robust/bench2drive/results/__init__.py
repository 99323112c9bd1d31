"""Official Bench2Drive results: read, scored, written.

`results_file` and `official_record` read, `official_totals` scores, `quirks` says which oddities of the official tools
changed a number, `export` writes. `episode_from_record` turns a record into an episode, so that requirements are judged
on results that were produced elsewhere (`results_option`, `results_source`, `results_executor`, `external_scopes`).
`motion_log` is the per-tick file of a route.
"""
