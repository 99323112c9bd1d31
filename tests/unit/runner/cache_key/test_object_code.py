from __future__ import annotations

import functools
import subprocess
import sys

from pytest_drive_robust.runner.cache_key.object_code import SESSION, code_of


def test_code_that_cannot_be_known_is_of_this_session_only():
    space: dict[str, object] = {}
    exec("class Typed:\n    pass", space)
    held = Handle()
    for unknown in (space["Typed"], Factory(iter(())), lambda: held, functools.partial(Factory, held)):
        assert SESSION in code_of(unknown)


def test_the_workers_of_a_run_share_what_stands_for_unknown_code():
    program = "from pytest_drive_robust.runner.cache_key.object_code import SESSION; print(SESSION)"
    told = [
        subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment
        ).stdout.strip()
        for environment in ({"PYTEST_XDIST_TESTRUNUID": "abc"}, {"PYTEST_XDIST_TESTRUNUID": "abc"}, {})
    ]
    assert told[0] == told[1] == "abc" != told[2]


class Factory:
    """An agent's factory with a state."""

    def __init__(self, gain: object = 1.0) -> None:
        self.gain = gain

    def __call__(self) -> object:
        return self

    def make(self) -> object:
        return self


class Handle:
    """Something of the operating system."""

    __slots__ = ()
