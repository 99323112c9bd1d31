"""By which rule so many routes are judged, and which numbers a rule cannot have."""

from __future__ import annotations

import math
import re

import pytest

from pytest_drive_robust.domain.verdict_rule import VERDICT_KINDS, VerdictRule
from pytest_drive_robust.errors import UsageError


@pytest.mark.parametrize(("routes", "kind"), [(1, "list"), (19, "list"), (20, "evidence"), (220, "evidence")])
def test_auto_is_evidence_from_20_routes_on_and_the_list_below(routes: int, kind: str) -> None:
    assert VerdictRule("auto", margin=0.2).for_routes(routes) == VerdictRule(kind, margin=0.2)
    for given in VERDICT_KINDS[1:]:
        assert VerdictRule(given).for_routes(routes).kind == given


def test_a_fail_among_several_requirements_has_its_share_of_alpha() -> None:
    assert VerdictRule().fail_alpha == VerdictRule().alpha == 0.05
    assert VerdictRule(alpha=0.06, family=3).fail_alpha == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("kind", ["evidnce"], "Did you mean 'evidence'?"),
        ("margin", [0.0, 1.0, -0.1, math.nan, "wide"], "margin is {!r}, expected a number between 0 and 1"),
        ("alpha", [0.0, 0.5, math.inf], "alpha is {!r}, expected a number between 0 and 0.5"),
        ("clean_floor", [-0.1, 100.1, math.nan], "is {!r}, expected 0..100"),
        ("family", [0, -1], "family is {!r}, expected a whole number of 1 or more"),
    ],
)
def test_what_no_rule_can_have_is_refused(name: str, values: list[object], expected: str) -> None:
    for value in values:
        with pytest.raises(UsageError, match=re.escape(expected.format(value))):
            VerdictRule(**{name: value})  # type: ignore[arg-type]


def test_the_ends_of_the_floor_can_be_had() -> None:
    assert [VerdictRule(clean_floor=floor).clean_floor for floor in (0.0, 100.0)] == [0.0, 100.0]
