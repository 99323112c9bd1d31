"""How tests of the plugin run the suite of the fixture `suite`."""

from __future__ import annotations

import pytest

GREEN = "RD under throttle 0.9 <= 0.30"
RED = "RD under throttle 0.3 <= 0.30"

processes = pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])


def run(suite, *args):
    return suite.runpytest_inprocess("--drive-robust", *args)
