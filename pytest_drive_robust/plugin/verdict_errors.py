"""How a test ends on a verdict that is no pass: broken, not judged, or left open."""

from __future__ import annotations

import pytest

from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.verdict.evaluate import Verdict

INCONCLUSIVE = "drive_inconclusive"
"""The property of a test whose verdict is open, with its first line."""


class BrokenRequirementError(pytest.fail.Exception):  # type: ignore[name-defined, misc]
    """A requirement that does not hold: the test fails with our message and no traceback."""

    def __init__(self, text: str, verdict: Verdict) -> None:
        super().__init__(text, pytrace=False)
        self.verdict = verdict


class NotJudgedError(pytest.fail.Exception):  # type: ignore[name-defined, misc]
    """There is no number to judge. Shown as an error of the test, not as a failure of the agent.

    `what` was to be judged; `why` says what went wrong and what to do.
    """

    def __init__(self, what: object, why: object) -> None:
        super().__init__(legible(f"ERROR: not judged: {what}\n{why}"), pytrace=False)
        self.what = what


NOT_JUDGED_ERROR = pytest.StashKey[NotJudgedError | None]()
"""In `item.stash`: why the test could not be judged when it asked last, None where it could."""
RAISED = pytest.StashKey[list[BaseException]]()
"""In `item.stash`: the errors that we raised in the test and that no report has shown yet."""
UNHEEDED = "drive_unheeded"
"""The property of the report on a test that passed although we raised an error in it: the first line of the error."""
WAIVED = pytest.StashKey[list[str]]()
"""In `item.stash`: the waivers of what the test found broken since the last report on it, signed."""


def is_open(report: pytest.TestReport) -> bool:
    """Return True for the report of a test that left a verdict open; the report of a subtest does not say so."""
    return not hasattr(report, "context") and any(name == INCONCLUSIVE for name, _ in report.user_properties)
