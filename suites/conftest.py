"""The order of the suites: the smoke suite is the short one, and says whether the tool works, so it comes first."""

from __future__ import annotations

from pathlib import Path

import pytest

_FIRST = Path(__file__).with_name("smoke")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: _FIRST not in item.path.parents)
