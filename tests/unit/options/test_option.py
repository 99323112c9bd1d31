"""An option is stated once, as a field; help, ini key, default and reading come of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from pytest_drive_robust.options.option import (
    GivenText,
    Option,
    combined,
    option,
    options_of,
    read_fields,
    switch,
    was_given,
)


def _span(low: GivenText, high: GivenText) -> tuple[int, int]:
    return int(low.text), int(high.text)


@dataclass(frozen=True)
class Wanted:
    name: str = option("--drive-name", "NAME", "nobody", "who drives")
    loud: bool = switch("--drive-loud", "say so")
    span: tuple[int, int] = combined(
        Option("--drive-low", "N", "1", "from"), Option("--drive-high", "N", "9", "to"), parse=_span
    )
    note: str = ""


class Source:
    rootpath = Path()

    def __init__(self, line: dict[str, object], ini: dict[str, str]) -> None:
        self._line = line
        self._ini = ini

    def getoption(self, name: str) -> object:
        return self._line.get(name)

    def getini(self, name: str) -> str:
        if name == "drive_loud":
            pytest.fail("a switch has no ini key")
        return self._ini.get(name, "")


def test_defaults_are_what_the_parsers_make_of_the_default_texts():
    assert Wanted() == Wanted("nobody", False, (1, 9))


def test_the_command_line_wins_over_the_ini_file_and_that_over_the_default():
    source = Source({"drive_name": "me", "drive_loud": True}, {"drive_name": "other", "drive_high": " 5 "})
    assert Wanted(**read_fields(Wanted, source)) == Wanted("me", True, (1, 5))
    assert [was_given(found, source) for found in options_of(Wanted)] == [True, True, False, True]


def test_a_field_without_an_option_is_nobodys_option():
    assert [found.flag for found in options_of(Wanted)] == [
        "--drive-name",
        "--drive-loud",
        "--drive-low",
        "--drive-high",
    ]
    assert options_of(Wanted, "span")[1].name == "drive_high"
