"""Refuses misspelt names of ours: ini keys, marks and our hook, which pytest ignores, and options.

A misspelt name has no effect, so another agent would be judged. pytest itself refuses an unknown option, but does not
name the nearest one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

import pytest

from pytest_drive_robust.errors import UnknownNameError, UsageError, nearest
from pytest_drive_robust.options.table import OPTIONS
from pytest_drive_robust.registry.plugins import HOOK

_MARK = "drive_robust"
_CLOSE = 0.8
"""Similarity (0..1) from which a mark counts as a misspelling: a suite may have its own marks, such as `robust`."""


def refuse_unknown_options(parser: pytest.Parser, args: Sequence[str]) -> None:
    """Raise `UsageError` for an option that begins with `--drive` and that no plugin added."""
    _, unknown = parser.parse_known_and_unknown_args(args)
    for word in unknown:
        flag = word.partition("=")[0]
        if flag.startswith("--drive"):
            raise UnknownNameError.of("option", flag, OPTIONS, hint="`pytest --help` tells what each does.")


def refuse_unknown_keys(config: pytest.Config) -> None:
    """Raise `UsageError` for an ini key that begins with `drive_` or `drive-` and that no plugin registered."""
    ours = {option.name: option for option in OPTIONS.values()}
    keys = [name for name, option in ours.items() if not option.is_switch]
    for key in _given_keys(config):
        if key in keys or not key.strip().startswith(("drive_", "drive-")) or _is_registered(key, config):
            continue
        meant = ours.get(nearest(key, ours) or "")
        if meant is not None and meant.is_switch:
            raise UsageError(
                f"there is no ini key named {key!r}: {meant.flag} is for the command line only. Give it there, or "
                "in addopts."
            )
        raise UnknownNameError.of("ini key", key, keys, hint="`pytest --help` tells what each does.")


def refuse_unknown_marks(item: pytest.Item) -> None:
    """Raise `UsageError` for an unregistered mark whose name is almost `drive_robust`."""
    for mark in item.iter_markers():
        if mark.name != _MARK and get_close_matches(mark.name, [_MARK], cutoff=_CLOSE):
            registered = {line.partition(":")[0].partition("(")[0].strip() for line in item.config.getini("markers")}
            if mark.name not in registered:
                raise UsageError(
                    f"there is no marker named {mark.name!r}. Did you mean {_MARK!r}? Another marker of that name has "
                    "to be registered under markers in the ini file."
                )


def refuse_unknown_hooks(plugin: object) -> None:
    """Raise `UsageError` for an optional hook of a plugin whose name is almost that of our hook.

    Nobody calls such a hook, and pluggy refuses an unknown hook only when the hook is not optional.
    """
    for name, value in vars(plugin).items():
        is_optional = getattr(value, "pytest_impl", {}).get("optionalhook", False)
        if is_optional and name != HOOK and get_close_matches(name, [HOOK], cutoff=_CLOSE):
            place = getattr(plugin, "__file__", None) or repr(plugin)
            raise UsageError(f"there is no hook named {name!r}. Did you mean {HOOK!r}? It stands in {place}.")


def _given_keys(config: pytest.Config) -> Iterable[str]:
    """Yield the keys of the ini file and of `-o`. pytest 9.1 deprecates `inicfg`; earlier versions lack `_inicfg`."""
    in_file = getattr(config, "_inicfg", None)
    yield from getattr(config, "inicfg", ()) if in_file is None else in_file
    for override in config.getoption("override_ini") or ():
        yield override.partition("=")[0]  # with its spaces, which make it another key for pytest


def _is_registered(key: str, config: pytest.Config) -> bool:
    try:
        config.getini(key)
    except ValueError as error:
        return not str(error).startswith("unknown configuration value")
    except pytest.UsageError:  # a value that the plugin of the key cannot use
        return True
    return True
