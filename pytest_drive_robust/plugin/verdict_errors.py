"""Errors and stash keys for a test whose verdict is no pass: broken, not judged, or inconclusive."""

from __future__ import annotations

import pytest

from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.verdict.evaluate import Verdict

INCONCLUSIVE = "drive_inconclusive"
"""The property of a test with an inconclusive verdict; the value is the verdict's first line."""


class BrokenRequirementError(pytest.fail.Exception):  # type: ignore[name-defined, misc]
    """A requirement that does not hold: the test fails with our message and no traceback."""

    def __init__(self, text: str, verdict: Verdict) -> None:
        super().__init__(text, pytrace=False)
        self.verdict = verdict


class NotJudgedError(pytest.fail.Exception):  # type: ignore[name-defined, misc]
    """The test has no number to judge. Shown as an error of the test, not as a failure of the agent.

    `what` is the requirement or number that was asked for; `why` says what went wrong and what to do.
    """

    def __init__(self, what: object, why: object) -> None:
        super().__init__(legible(f"ERROR: not judged: {what}\n{why}"), pytrace=False)
        self.what = what


UNANSWERED = pytest.StashKey[list[BaseException]]()
"""In `item.stash`: the errors by which calls of `drive` ended without an answer, `NotJudgedError` or not of ours."""
RAISED = pytest.StashKey[list[BaseException]]()
"""In `item.stash`: the errors that we raised in the test and that no report has shown yet."""
UNHEEDED = "drive_unheeded"
"""The property of the report on a test that passed although we raised an error in it: the first line of the error."""
BODY_ENDED = pytest.StashKey[bool]()
"""In `item.stash`: False while the body of the test runs, when only subtests are reported."""
WAIVED = pytest.StashKey[list[str]]()
"""In `item.stash`: the signatures of the waivers that the test used since its last report."""


def is_open(report: pytest.TestReport) -> bool:
    """Return True for the report of a test with an inconclusive verdict; False for the report of a subtest."""
    return not hasattr(report, "context") and any(name == INCONCLUSIVE for name, _ in report.user_properties)
