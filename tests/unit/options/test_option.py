"""A field names the flag of its option; default, ini key and reading come of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from pytest_drive_robust.options.option import GivenText, option, options_of, read_fields, was_given


def _span(low: GivenText, high: GivenText) -> tuple[float, float]:
    return float(low.text), float(high.text)


@dataclass(frozen=True)
class Wanted:
    name: str = option("--drive-agent")
    fresh: bool = option("--drive-fresh")
    span: tuple[float, float] = option("--drive-alpha", "--drive-margin", parse=_span)
    note: str = ""


class Source:
    rootpath = Path()

    def __init__(self, line: dict[str, object], ini: dict[str, str]) -> None:
        self._line = line
        self._ini = ini

    def getoption(self, name: str) -> object:
        return self._line.get(name)

    def getini(self, name: str) -> str:
        if name == "drive_fresh":
            pytest.fail("a switch has no ini key")
        return self._ini.get(name, "")


def test_defaults_are_what_the_parsers_make_of_the_default_texts():
    assert Wanted() == Wanted("tcp", False, (0.05, 0.1))


def test_the_command_line_wins_over_the_ini_file_and_that_over_the_default():
    source = Source({"drive_agent": "me", "drive_fresh": True}, {"drive_agent": "other", "drive_margin": " 0.5 "})
    assert Wanted(**read_fields(Wanted, source)) == Wanted("me", True, (0.05, 0.5))
    assert [was_given(found.flag, source) for found in options_of(Wanted)] == [True, True, False, True]


def test_a_field_without_an_option_is_nobodys_option():
    assert [found.flag for found in options_of(Wanted)] == [
        "--drive-agent",
        "--drive-fresh",
        "--drive-alpha",
        "--drive-margin",
    ]
    assert options_of(Wanted, "span")[1].name == "drive_margin"


def test_a_flag_that_the_table_does_not_state_is_no_option():
    with pytest.raises(KeyError, match="--drive-nobody"):
        option("--drive-nobody")
