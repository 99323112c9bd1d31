"""Pure functions from one `RunResult` (or one verdict) to text and files; `run_records` is a run that was stored."""
