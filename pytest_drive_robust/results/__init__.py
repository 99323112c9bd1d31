"""Stored runs for work of your own: `read_run` gives objects and tables, `drive-robust export` files of other tools."""

from pytest_drive_robust.results.run import Run, read_run
from pytest_drive_robust.results.tables import TABLES

__all__ = ["TABLES", "Run", "read_run"]
