"""The plugin: every module that imports pytest. pytest loads this package by its entry point and finds the hooks here.

Without `--drive-robust` the plugin does nothing. `hooks` imports the other modules when a session needs them.
"""

from __future__ import annotations

from pytest_drive_robust.plugin.fixtures import drive, drive_agent
from pytest_drive_robust.plugin.hooks import (
    pytest_addhooks,
    pytest_addoption,
    pytest_collection_finish,
    pytest_collection_modifyitems,
    pytest_configure,
    pytest_load_initial_conftests,
    pytest_make_collect_report,
    pytest_make_parametrize_id,
    pytest_plugin_registered,
    pytest_unconfigure,
)

__all__ = [
    "drive",
    "drive_agent",
    "pytest_addhooks",
    "pytest_addoption",
    "pytest_collection_finish",
    "pytest_collection_modifyitems",
    "pytest_configure",
    "pytest_load_initial_conftests",
    "pytest_make_collect_report",
    "pytest_make_parametrize_id",
    "pytest_plugin_registered",
    "pytest_unconfigure",
]
