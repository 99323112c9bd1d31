"""Collects the usage errors of a session, from registration and collection, and shows them together: exit code 4."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

import pytest

from pytest_drive_robust.errors import DriveRobustError, UsageError, did_you_mean
from pytest_drive_robust.plugin.process_roles import is_controller, is_worker, output_of, worker_output
from pytest_drive_robust.registry.plugins import HOOK

_PROBLEMS = pytest.StashKey["dict[str, str]"]()
_OUTPUT = "drive_robust_problems"


def problems_of(config: pytest.Config) -> dict[str, str]:
    """Return the problems so far, in order: each message with its first place, `""` when the run itself is wrong."""
    return config.stash.setdefault(_PROBLEMS, {})


def note_problem(config: pytest.Config, where: str, attempt: Callable[[], object]) -> None:
    """Call `attempt`; add a `UsageError` that it raises to the session's problems, with its place `where`."""
    try:
        attempt()
    except UsageError as error:
        problems_of(config).setdefault(str(error), where)


def refuse_problems(session: pytest.Session) -> None:
    """Raise pytest's usage error for the session's problems. In a worker, drop all tests: the controller reports."""
    problems = problems_of(session.config)
    if problems and is_worker(session.config):
        session.items.clear()
    elif problems:
        raise pytest.UsageError("\n".join(_sentences(problems)))


def usage_error_in(report: pytest.CollectReport) -> UsageError | None:
    """Return the `UsageError` that made a collection fail, also one raised by a conftest.py; None for other reasons."""
    call = report.__dict__.get("call")
    error = call.excinfo.value if call is not None and call.excinfo is not None else None
    error = getattr(error, "cause", error)
    return error if isinstance(error, UsageError) else None


def told_of_hook(error: Exception) -> Exception:
    """Return a usage error with the line where our hook raised `error`; return an error from elsewhere unchanged.

    An error in a conftest.py that is loaded during collection needs no line from us: pytest shows it.
    """
    frames = traceback.extract_tb(error.__traceback__)
    file = next((frame.filename for frame in frames if frame.name == HOOK), None)
    if file is None or isinstance(error, (DriveRobustError, pytest.UsageError)):
        return error
    line = [frame.lineno for frame in frames if frame.filename == file][-1]
    meant = did_you_mean(error.name, dir(error.obj)) if isinstance(error, AttributeError) and error.name else ""
    return UsageError(f"{HOOK} raised {type(error).__name__}: {error} ({file}:{line}).{meant}")


def raise_as_pytests(error: Exception) -> None:
    """Raise pytest's usage error for a `UsageError`: exit code 4 without a traceback. Return for any other error."""
    if isinstance(error, UsageError):
        raise pytest.UsageError(str(error)) from None


class ProblemCourier:
    """Carries usage errors from the workers of pytest-xdist, which collect, to the controller, which exits."""

    def __init__(self, problems: dict[str, str]) -> None:
        self._problems = problems

    def pytest_testnodedown(self, node: Any) -> None:
        """Take the problems of an ended worker (a hook of pytest-xdist). A crashed worker brings none."""
        for problem, place in output_of(node).get(_OUTPUT, {}).items():
            self._problems.setdefault(problem, place)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Hand the problems over in a worker; set exit code 4 on the controller."""
        if is_worker(session.config):
            worker_output(session.config)[_OUTPUT] = self._problems
        elif self._problems and is_controller(session.config):
            session.exitstatus = pytest.ExitCode.USAGE_ERROR

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Write the problems on the controller, as pytest would without workers."""
        if is_controller(terminalreporter.config):
            for sentence in _sentences(self._problems):
                terminalreporter.write_line(f"ERROR: {sentence}", red=True)


def _sentences(problems: dict[str, str]) -> list[str]:
    """Return `"test_suite.py::test_it: there is no agent ..."`, each problem once, at its first place."""
    return [f"{place}: {problem}" if place else problem for problem, place in problems.items()]
