"""A property over stacks of failures, driven through the fixture."""

from __future__ import annotations

import pytest

PROPERTY = """
from hypothesis import given
from pytest_drive_robust import InferenceLatency, requirement
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.testing import strategies

kinds = [InferenceLatency, default_registry().perturbations()["throttle"]]

@strategies.driving(max_examples=6, derandomize=True)
@given(setting=strategies.settings(kinds, min_size=2, max_size=2))
def test_stacks(drive, setting):
    failure = drive.minimal(requirement("RD", setting) <= 0.30)
    assert failure is None, str(failure)
"""
LADDER = """
Throttle.ladder = ("share", (0.9, 0.7, 0.5, 0.3, 0.1))
"""


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["one-process", "two-workers"])
def test_a_stack_that_fails_is_shrunk_to_a_test_case_to_keep(suite, workers):
    result = suite(test=PROPERTY, conftest=LADDER).runpytest_inprocess(
        "--drive-robust", "--drive-verdict", "point", *workers
    )
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "*smallest setting that fails: throttle 0.* (from * ms latency and throttle *, * verdicts)",
            "*def test_throttle_0_*(drive):",
            '*drive.check(requirements("RD under throttle 0.* <= 0.30")[[]0[]])*',
        ]
    )
