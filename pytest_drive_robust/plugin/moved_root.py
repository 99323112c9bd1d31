"""Refuses a run in which pytest took the value of an option for a test path and chose another root folder or ini file.

pytest chooses both before the options of plugins are known. In `--drive-store ../store`, when `../store` exists, pytest
takes `../store` for a folder of tests and may then miss the ini file, which names the agent.
"""

from __future__ import annotations

import inspect
import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.option import asked_for, was_given

_RUNS = ("--drive-save", "--drive-compare")
"""The options that store a run, or look for one."""


def refuse_moved_root(config: pytest.Config) -> None:
    """Raise `UsageError` when pytest reads another ini file than the test paths alone would give.

    Raises `UsageError` as well for another root folder, when episodes or runs are kept there.
    """
    taken = _taken(config)
    if not taken:
        return
    meant = found_for(config, config.option.file_or_dir)
    root, ini = (config.rootpath, config.inipath) if meant is None else (meant.root, meant.ini)
    if meant is None:
        said = "it may read another ini file"
    elif ini != config.inipath:
        said = f"it reads {_named(config.inipath)} instead of {_named(ini)}"
    elif root != config.rootpath and _stores_in_root(config):
        said = f"it keeps episodes and runs in {str(config.rootpath)!r} instead of {str(root)!r}"
    else:
        return
    raise UsageError(
        f"pytest takes {' and '.join(map(repr, taken))} for a folder of tests, so {said}. Write an option and its "
        "value as one word, as in --drive-store=FOLDER."
    )


def _stores_in_root(config: pytest.Config) -> bool:
    return not was_given("--drive-store", config) or any(asked_for(flag, config) for flag in _RUNS)


def _taken(config: pytest.Config) -> list[str]:
    """Return the words of the command line that are existing paths but no test paths."""
    here, option = config.invocation_params.dir, config.option
    words = [*shlex.split(os.environ.get("PYTEST_ADDOPTS", "")), *map(str, config.invocation_params.args)]
    known = (*option.file_or_dir, option.rootdir, option.inifilename)
    return [word for word in words if not word.startswith("-") and word not in known and os.path.exists(here / word)]


class Found(NamedTuple):
    """The root folder and the ini file that pytest finds for some test paths, and the keys of the ini file."""

    root: Path
    ini: Path | None
    keys: Mapping[str, object]


def found_for(config: pytest.Config, places: Sequence[str]) -> Found | None:
    """Return what pytest finds for the test paths `places` alone; None when it cannot be asked.

    What finds them is private in pytest, and nothing public does without loading every plugin and conftest.py again.
    Where a new pytest moves it, what may be wrong is refused, and `tests/plugin/test_private_names_of_pytest.py` fails.
    """
    try:
        from _pytest.config.findpaths import determine_setup
    except ImportError:
        return None
    here, option = config.invocation_params.dir, config.option
    asked = {
        "inifile": option.inifilename and str(here / option.inifilename),
        "override_ini": option.override_ini,  # from pytest 9 on
        "args": [str(here / place) for place in places],
        "rootdir_cmd_arg": option.rootdir and str(config.rootpath),
        "invocation_dir": here,
    }
    wanted = inspect.signature(determine_setup).parameters
    root, ini, keys, *_ = determine_setup(**{name: value for name, value in asked.items() if name in wanted})
    return Found(root, ini, {key: getattr(value, "value", value) for key, value in keys.items()})


def _named(ini: Path | None) -> str:
    return "no ini file" if ini is None else repr(str(ini))
