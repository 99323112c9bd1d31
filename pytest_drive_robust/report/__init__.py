"""Pure functions from one `RunResult` (or one verdict) to text and files."""
