from __future__ import annotations

import pytest

from pytest_drive_robust.errors import UnknownNameError
from pytest_drive_robust.testing import Check, ContractReport

GOOD, BAD = Check("methods", True, "they are there."), Check("reset", False, "it remembers.")


def test_a_report_is_true_only_where_something_was_checked_and_nothing_failed():
    assert ContractReport("Mine", (GOOD,))
    assert not ContractReport("Mine", (GOOD, BAD))
    assert not ContractReport("Mine", ())


def test_a_report_gives_its_checks_one_by_one_and_by_name():
    report = ContractReport("Mine", (GOOD, BAD))
    assert list(report) == [GOOD, BAD]
    assert report["reset"] is BAD
    with pytest.raises(UnknownNameError, match="named 'rest'"):
        report["rest"]
