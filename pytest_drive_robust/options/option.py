"""A dataclass whose fields are options: each field names its flag in `options.table` and parses what was given.

::

    @dataclass(frozen=True, slots=True)
    class RunOptions:
        agent: str = option("--drive-agent")
        seeds: tuple[int, ...] = option("--drive-seeds", parse=seed_list)
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import field, fields
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.table import OPTIONS, Option

_OPTIONS, _PARSE = "options", "parse"


class OptionSource(Protocol):
    """The part of `pytest.Config` that options are read from."""

    @property
    def rootpath(self) -> Path:
        """The root folder, which paths of the ini file start from."""

    @property
    def invocation_params(self) -> Any:
        """The arguments of the pytest call; `dir` is the folder of the call."""

    def getoption(self, name: str) -> Any:
        """Return the value of a command line option."""

    def getini(self, name: str) -> Any:
        """Return the value of an ini key, from `-o` if that gives one."""


class GivenText(NamedTuple):
    """The text given for an option, or its default. `source` is None when only defaults are read."""

    flag: str
    text: str
    source: OptionSource | None = None


def _usual(given: GivenText) -> str | bool:
    """Return the text of an option; for a switch, whether the switch was given."""
    return bool(given.text) if OPTIONS[given.flag].is_switch else given.text


def option(*flags: str, parse: Callable[..., Any] = _usual) -> Any:
    """Return a dataclass field whose value comes from one option or several.

    `parse` gets one `GivenText` for each flag, in order, and returns the value, or raises `UsageError`.
    """
    options = tuple(OPTIONS[flag] for flag in flags)
    return field(
        default_factory=lambda: parse(*(GivenText(option.flag, option.default) for option in options)),
        metadata={_OPTIONS: options, _PARSE: parse},
    )


def options_of(cls: Any, name: str = "") -> tuple[Option, ...]:
    """Return the options of a dataclass, or of its field `name`, in the order of the fields."""
    return tuple(
        option for item in fields(cls) if name in ("", item.name) for option in item.metadata.get(_OPTIONS, ())
    )


def read_fields(cls: Any, source: OptionSource) -> dict[str, Any]:
    """Return the values of all fields that are options. Raises `UsageError` for values that cannot be used."""
    return {
        item.name: _parsed(item.metadata[_PARSE], [_given(option, source) for option in item.metadata[_OPTIONS]])
        for item in fields(cls)
        if _OPTIONS in item.metadata
    }


def _parsed(parse: Callable[..., Any], given: Sequence[GivenText]) -> Any:
    try:
        return parse(*given)
    except (OSError, ValueError) as error:  # a path may be too long or hold a NUL, a number have too many digits
        why = getattr(error, "strerror", None) or error
        raise UsageError(f"{given[0].flag} is {given[0].text!r}, which cannot be used: {why}.") from None


def was_given(flag: str, source: OptionSource) -> bool:
    """Return True when the command line or the ini file sets an option."""
    return bool(_text(OPTIONS[flag], source))


def asked_for(flag: str, source: OptionSource) -> bool:
    """Return True when the command line sets an option, whatever the ini file says."""
    return bool(source.getoption(OPTIONS[flag].name))


def _given(option: Option, source: OptionSource) -> GivenText:
    return GivenText(option.flag, _text(option, source) or option.default, source)


def _text(option: Option, source: OptionSource) -> str:
    """Return the command line's value, else that of `-o`, else the ini file's, else `""`.

    A blank value in the ini file or in `-o` means the default, as for keys of pytest. A leading `~` is the home folder,
    as in options of pytest: shells leave it in `--drive-store=~/store`. Raises `UsageError` for a blank value of the
    flag, for example from an unset variable of CI: the run would judge another agent or compare nothing.
    """
    value = source.getoption(option.name)
    if option.is_switch:
        return "on" if value else ""
    if value is not None and not str(value).strip():
        usual = f", else {option.default!r}" if option.default else ""
        raise UsageError(
            f"{option.flag} is empty, expected {option.metavar}: {option.help}. Leave it out to use the value of the "
            f"ini file{usual}; '-o {option.name}=' sets the ini file aside."
        )
    return os.path.expanduser(str(source.getini(option.name) if value is None else value).strip())
