"""Refuses a run of several suites of which one has an ini file of its own that pytest does not read.

pytest reads one ini file for all test paths of a command. In `pytest a b` that of `a` may hold for `b`, too, whose
requirements would be judged on another agent or other routes than its own ini file names.
"""

from __future__ import annotations

import os

import pytest

from pytest_drive_robust.errors import UsageError, from_here
from pytest_drive_robust.options.option import asked_for
from pytest_drive_robust.options.table import OPTIONS
from pytest_drive_robust.plugin.moved_root import found_for


def refuse_unread_ini(config: pytest.Config) -> None:
    """Raise `UsageError` when the ini file of a test path is not read and gives one of our keys another value.

    `-c` names the file that is meant, and an option of the command line holds for all tests: both are respected.
    """
    here, option = config.invocation_params.dir, config.option
    places = [place for place in option.file_or_dir if os.path.exists(here / place.partition("::")[0])]
    if option.inifilename or len(places) < 2:
        return
    for place in places:
        found = found_for(config, [place])
        if found is None or found.ini is None or found.ini == config.inipath:
            continue
        unread = [
            f"{item.name} = {found.keys[item.name]}"
            for item in OPTIONS.values()
            if item.name in found.keys
            and not asked_for(item.flag, config)
            and str(found.keys[item.name]) != str(config.getini(item.name))
        ]
        if unread:
            read = "no ini file" if config.inipath is None else repr(str(from_here(config.inipath)))
            raise UsageError(
                f"{place!r} has an ini file of its own, {str(from_here(found.ini))!r}, with {', '.join(unread)}, but "
                f"pytest reads one for all tests of a command, here {read}. Drive it in a command of its own, or say "
                "with -c which file holds for all."
            )
