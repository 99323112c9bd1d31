"""Asks pytest what the marks of a test mean, by calling the hooks of its own plugin `skipping` alone.

What evaluates `skipif` and `xfail` is private in pytest; hooks, and names of plugins (`-p no:skipping`), are not.
"""

from __future__ import annotations

from typing import Any

import pytest


def is_skipped(item: pytest.Item) -> bool:
    """Return True for a test that pytest will not run because of its marks: `skip`, `skipif`, `xfail(run=False)`."""
    try:
        _hook_of(item, "pytest_runtest_setup", "skipping")(item=item)
    except (pytest.skip.Exception, pytest.xfail.Exception):
        return True
    except (Exception, pytest.fail.Exception):  # a condition that cannot be evaluated: pytest says so in the test
        return False
    return False


def may_fail_by(item: pytest.Item, error: BaseException) -> bool:
    """Return whether the `xfail` of a test that has run allows `error`: an xfail may name exceptions."""

    def fail() -> None:
        raise error

    call = pytest.CallInfo.from_call(fail, when="call")
    report = _hook_of(item, "pytest_runtest_makereport", "runner", "skipping")(item=item, call=call)
    return hasattr(report, "wasxfail")


def names_errors(item: pytest.Item) -> bool:
    """Return whether the `xfail` of a test that has run allows only some errors: those that its `raises` names."""
    return not may_fail_by(item, _UnheardOfError())


class _UnheardOfError(BaseException):
    """An error that no test names."""


def _hook_of(item: pytest.Item, name: str, *plugins: str) -> Any:
    """Return the hook `name` that only the given plugins of pytest answer; one that is switched off does not."""
    manager = item.config.pluginmanager
    asked = [manager.get_plugin(plugin) for plugin in plugins]
    others = [plugin for plugin in manager.get_plugins() if not any(plugin is one for one in asked)]
    return manager.subset_hook_caller(name, others)
