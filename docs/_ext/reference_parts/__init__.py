"""The parts of the reference that the code writes, each as reStructuredText: `.. generated:: NAME` inserts one."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from reference_parts.command_line import commands, exit_codes, ini_keys, marker, options, programs
from reference_parts.environment import environment
from reference_parts.failures import failure_table, failures
from reference_parts.metrics import abilities, metrics, penalties
from reference_parts.names import error_names, names, public_names, testing_names
from reference_parts.scenarios import scenarios
from reference_parts.schema import schema

__all__ = ["PARTS"]

PARTS: Mapping[str, Callable[[], str]] = {
    "options": options,
    "ini-keys": ini_keys,
    "marker": marker,
    "commands": commands,
    "programs": programs,
    "metrics": metrics,
    "penalties": penalties,
    "abilities": abilities,
    "failures": failures,
    "failure-table": failure_table,
    "scenarios": scenarios,
    "schema": schema,
    "environment": environment,
    "exit-codes": exit_codes,
    "names": names,
    "public-names": public_names,
    "testing-names": testing_names,
    "error-names": error_names,
}
"""Every part by its name."""
