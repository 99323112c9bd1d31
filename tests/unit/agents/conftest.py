"""What all tests of agents share: torch computes on one thread, as in a worker process."""

from __future__ import annotations

import sys

import pytest


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> None:
    if "torch" in sys.modules:  # a test that needs torch imports it at its top
        sys.modules["torch"].set_num_threads(1)
