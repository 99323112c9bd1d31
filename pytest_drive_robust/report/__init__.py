"""Reports: pure functions from one `RunResult` (or one verdict) to text and files; `run_records` reads a stored run."""
