"""`--fail-on`: what may get worse."""

from __future__ import annotations

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.allowance import DEFAULT_ALLOWANCES, Allowance, parse_allowances


@pytest.mark.parametrize(
    ("text", "allowance"),
    [
        ("ds:-5%", Allowance("DS", 0.05, relative=True)),
        ("DS:-3", Allowance("DS", 3.0)),
        ("sr:-0.05", Allowance("SR", 0.05)),
        (" sr : -5 % ", Allowance("SR", 0.05, relative=True)),
        ("rd:+0.05", Allowance("RD", 0.05)),
        ("rd:+0", Allowance("RD", 0.0)),
    ],
)
def test_an_allowance_is_read_and_written(text: str, allowance: Allowance) -> None:
    (found,) = parse_allowances([text], source="--fail-on")
    assert found == allowance
    assert parse_allowances([str(found)], source="--fail-on") == (allowance,)


def test_several_may_stand_in_one_text_and_repeat() -> None:
    found = parse_allowances(["ds:-5%,rd:+0.05", "ds:-5%"], source="--fail-on")
    assert [str(item) for item in found] == ["ds:-5%", "rd:+0.05"]


def test_nothing_given_is_the_default() -> None:
    assert parse_allowances([], source="--fail-on") == DEFAULT_ALLOWANCES


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("dss:-5%", "Did you mean 'ds'"),
        ("ds:5%", "expected a drop of DS or SR"),
        ("ds", "expected a drop of DS or SR"),
        ("ds:+5%", "DS gets worse by dropping"),
        ("rd:-0.05", "RD gets worse by rising"),
        ("rd:+5%", "write rd:+0.05"),
        ("ds:-100%", "allows everything"),
        ("sr:-1", "allows everything"),
        ("", "which is empty; expected a drop"),
        (" , ", "which is empty; expected a drop"),
    ],
)
def test_what_cannot_be_used_is_refused_with_advice(text: str, told: str) -> None:
    with pytest.raises(UsageError) as refused:
        parse_allowances([text], source="--fail-on")
    assert told in str(refused.value)
    assert "--fail-on" in str(refused.value)
