"""Usage errors of a session: found while names are registered and tests are collected, shown together, exit code 4."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

import pytest

from pytest_drive_robust.errors import DriveRobustError, UsageError, did_you_mean
from pytest_drive_robust.plugin.process_roles import is_controller, is_worker, output_of, worker_output

_PROBLEMS = pytest.StashKey["dict[str, str]"]()
_HOOK = "pytest_drive_robust_register"
_OUTPUT = "drive_robust_problems"


def problems_of(config: pytest.Config) -> dict[str, str]:
    """Return the problems found so far in the order found: what is wrong, and where first; "" for the run itself."""
    return config.stash.setdefault(_PROBLEMS, {})


def note_problem(config: pytest.Config, where: str, attempt: Callable[[], object]) -> None:
    """Call `attempt`; a usage error in it becomes one of the session's problems."""
    try:
        attempt()
    except UsageError as error:
        problems_of(config).setdefault(str(error), where)


def refuse_problems(session: pytest.Session) -> None:
    """Raise pytest's usage error for the session's problems. A worker runs nothing: its controller reports them."""
    problems = problems_of(session.config)
    if problems and is_worker(session.config):
        session.items.clear()
    elif problems:
        raise pytest.UsageError("\n".join(_sentences(problems)))


def usage_error_in(report: pytest.CollectReport) -> UsageError | None:
    """Return our usage error behind a failed collection, also when a conftest.py raised it."""
    call = report.__dict__.get("call")
    error = call.excinfo.value if call is not None and call.excinfo is not None else None
    error = getattr(error, "cause", error)
    return error if isinstance(error, UsageError) else None


def told_of_hook(error: Exception) -> Exception:
    """Return a usage error with the place where our hook raised `error`; an error from elsewhere is returned as it is.

    A conftest.py that is loaded while tests are collected needs none: pytest shows its line.
    """
    frames = traceback.extract_tb(error.__traceback__)
    file = next((frame.filename for frame in frames if frame.name == _HOOK), None)
    if file is None or isinstance(error, (DriveRobustError, pytest.UsageError)):
        return error
    line = [frame.lineno for frame in frames if frame.filename == file][-1]
    meant = did_you_mean(error.name, dir(error.obj)) if isinstance(error, AttributeError) and error.name else ""
    return UsageError(f"{_HOOK} raised {type(error).__name__}: {error} ({file}:{line}).{meant}")


def raise_as_pytests(error: Exception) -> None:
    """Raise pytest's usage error in place of ours, for exit code 4 without a traceback; return for any other error."""
    if isinstance(error, UsageError):
        raise pytest.UsageError(str(error)) from None


class ProblemCourier:
    """Carries usage errors from the workers of pytest-xdist, which collect, to the controller, which exits."""

    def __init__(self, problems: dict[str, str]) -> None:
        self._problems = problems

    def pytest_testnodedown(self, node: Any) -> None:
        """Take the problems of a worker that ended (a hook of pytest-xdist). One that crashed brings none."""
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
        """Say what pytest itself would have said without workers."""
        if is_controller(terminalreporter.config):
            for sentence in _sentences(self._problems):
                terminalreporter.write_line(f"ERROR: {sentence}", red=True)


def _sentences(problems: dict[str, str]) -> list[str]:
    """Return `"test_suite.py::test_it: there is no agent ..."`, each problem once, at its first place."""
    return [f"{place}: {problem}" if place else problem for problem, place in problems.items()]
