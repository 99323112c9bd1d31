"""Reads stored runs for your own analysis: `read_run` gives objects and tables; `drive-robust export` writes files."""

from pytest_drive_robust.results.run import Run, read_run
from pytest_drive_robust.results.tables import TABLES

__all__ = ["TABLES", "Run", "read_run"]
