"""Official Bench2Drive results: read (`results_file`, `record`), scored (`scores`), written (`export`).

`episodes` turns a record into an episode, so that requirements are judged on results that were produced elsewhere
(`supply`). `motion_log` is the per-tick file of a route, `statuses` and `messages` are the words of the records.
"""
