"""Reports a run in the controller of pytest-xdist, or in the only process: the header, the table, the exit code."""

from __future__ import annotations

from typing import Any

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.options.run import DEFAULT_SIMULATOR, RunOptions
from pytest_drive_robust.plugin.collection import DESELECTED
from pytest_drive_robust.plugin.driving import BROKE, MAY_FAIL, NOT_JUDGED, OWN_VERDICT
from pytest_drive_robust.plugin.process_roles import output_of
from pytest_drive_robust.plugin.run_outputs import BROKEN_TESTS, MEND_TESTS, SELECT_TESTS, WRITE_TESTS, RunOutputs
from pytest_drive_robust.plugin.stopped_tests import STOPPED
from pytest_drive_robust.plugin.terminal import is_terminal
from pytest_drive_robust.plugin.usage_errors import problems_of
from pytest_drive_robust.plugin.verdict_errors import UNHEEDED, is_open
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.page import columns_of_screen
from pytest_drive_robust.runner.before_driving import routes_of
from pytest_drive_robust.simulators.routes import default_spec, resolve_routes

_RUNS_NOTHING = ("collectonly", "setupplan", "setuponly", "drive_plan")
_ENDED_EARLY = "the run {}: requirements whose tests had not ended by then are not in this report"
_BROKE = "{} broke{}: what it had not judged by then is not in this report"
_STOPPED = "{} stopped at call {} of drive{}: what stands after that was not judged and is not in this report"
_OWN_VERDICT = "{} failed by its own assert or pytest.fail{}, which is no requirement of this report"
_MOST_UNHEEDED = 5
_WHOLE = ("", "suites", "robustness")  # below the root folder; `drive-robust init` writes the last one
_NARROWING = ("ignore", "ignore_glob", "lf")  # these leave out whole files, without a call of `pytest_deselected`


class ReportingPlugin:
    """Shows the outputs of the run: in the only process, or in the controller of pytest-xdist."""

    def __init__(self, config: pytest.Config, outputs: RunOutputs, header: str) -> None:
        self._config = config
        self._outputs = outputs
        self._header = header
        self._ran = False
        self._broke = False
        self._interrupted = False
        self._lost_worker = False
        self._deselected = False
        self._ended: set[str] = set()
        self._broken_tests: dict[str, None] = {}
        self._stopped_tests: dict[str, int] = {}
        self._own_verdicts: dict[str, None] = {}
        self._may_fail: set[str] = set()
        self._unheeded: list[str] = []

    def pytest_report_header(self) -> str:
        """Return the effective options, in one line."""
        return self._header

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        """Note whether tests run; pytest does not call this hook with --fixtures, --markers and the like."""
        self._ran = runs_tests(self._config)

    def pytest_deselected(self) -> None:
        """Note that tests were left out, as pytest-split and a conftest.py do it without an option of pytest."""
        self._deselected = True

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object) -> None:
        """Note whether an ended worker deselected tests or crashed (a hook of pytest-xdist)."""
        self._deselected |= output_of(node).get(DESELECTED, False)
        self._lost_worker |= bool(error)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """Note that a test has ended, here or in a worker."""
        self._ended.add(nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file whose collection failed: with --continue-on-collection-errors the other files run."""
        if report.failed:
            self._broken_tests[report.nodeid] = None

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a test that passed although `drive` raised in it: a thread or an `except` swallowed the error.

        Notes as well a test that broke before it had asked `drive` for everything, one that its own verdict stopped or
        failed at its end, and a test that was expected to fail and whose verdict is still inconclusive.
        """
        if getattr(report, MAY_FAIL, False):
            self._may_fail.add(report.nodeid)
        if report.failed and getattr(report, BROKE, False):
            self._broken_tests[report.nodeid] = None
        elif hasattr(report, STOPPED) and report.outcome in ("failed", "skipped"):  # "rerun" is not the last attempt
            self._stopped_tests[report.nodeid] = getattr(report, STOPPED)
        elif report.failed and getattr(report, OWN_VERDICT, False):
            self._own_verdicts[report.nodeid] = None
        told = [value for name, value in report.user_properties if name == UNHEEDED]
        self._unheeded += [f"{report.nodeid} passed although drive raised in it: {line}" for line in told]

    @pytest.hookimpl(tryfirst=True)
    def pytest_report_teststatus(
        self, report: pytest.TestReport
    ) -> tuple[str, str, str | tuple[str, dict[str, bool]]] | None:
        """Show a test that could not be judged as an error, and a test with an inconclusive verdict as `~`."""
        if report.failed and getattr(report, NOT_JUDGED, False):  # a plugin that reruns the test sets another outcome
            return "error", "E", "ERROR"
        if report.when == "call" and report.passed and is_open(report):
            return "inconclusive", "~", ("INCONCLUSIVE", {"yellow": True})
        return None

    def pytest_keyboard_interrupt(self) -> None:
        """Note Ctrl-C, and a `pytest.exit`, which may end the run with any exit code."""
        self._interrupted = True

    def pytest_internalerror(self) -> None:
        """Note that pytest itself broke: after that in a worker, pytest-xdist may lose a test and exit with 0."""
        self._broke = True

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write every report; fail a run that drove no episode or that could not write a file."""
        if self._ran and not problems_of(self._config):
            early = self._why_early(session)
            if early:
                self._outputs.note(_ENDED_EARLY.format(early))
            if self._broken_tests:
                first, *others = self._broken_tests
                self._outputs.note(_BROKE.format(first, f", and {len(others)} more" if others else ""))
            if self._stopped_tests:
                (first, calls), *more = self._stopped_tests.items()
                self._outputs.note(_STOPPED.format(first, calls, f", and so did {len(more)} more" if more else ""))
            if self._own_verdicts:
                first, *others = self._own_verdicts
                self._outputs.note(_OWN_VERDICT.format(first, f", and so did {len(others)} more" if others else ""))
            for sentence in self._unheeded[:_MOST_UNHEEDED]:
                self._outputs.note(f"warning: {sentence}")
            if len(self._unheeded) > _MOST_UNHEEDED:
                self._outputs.note(f"warning: and so did {len(self._unheeded) - _MOST_UNHEEDED} more tests")
            partial = bool(early or self._broken_tests)
            whole = not (self._deselected or partial or self._stopped_tests) and every_test_ran(session)
            problem = self._outputs.finish(
                whole=whole,
                ended_early=partial,
                stopped=tuple(self._stopped_tests),
                own_verdicts=tuple(self._own_verdicts),
                may_fail=self._may_fail,
                advice=self._advice(session),
            )
            if problem and session.exitstatus == pytest.ExitCode.OK:
                session.exitstatus = pytest.ExitCode.TESTS_FAILED
        if self._broke and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.INTERNAL_ERROR

    def _advice(self, session: pytest.Session) -> str:
        """Return the advice for a run that drove nothing."""
        if session.testsfailed:
            return BROKEN_TESTS if session.testscollected else MEND_TESTS
        return SELECT_TESTS if session.testscollected or self._deselected else WRITE_TESTS

    def _why_early(self, session: pytest.Session) -> str:
        """Return how the run ended before all its tests did, such as by `-x`, Ctrl-C or a crash; else `""`."""
        if len(self._ended) >= session.testscollected:
            return ""
        if self._interrupted:
            return "was interrupted"
        if self._lost_worker:
            return "lost a worker process"
        return "ended early" if session.shouldstop or session.shouldfail or self._broke else ""

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Write the table, and why the run is not green."""
        width = columns_of_screen(is_terminal=is_terminal(terminalreporter))
        text = self._outputs.text(colour=terminalreporter.hasmarkup, width=width)
        if text:
            terminalreporter.section("drive-robust")
            terminalreporter.write_line(text)
        for title, text in self._outputs.sections(colour=terminalreporter.hasmarkup, width=width):
            terminalreporter.section(title)
            terminalreporter.write_line(text)


def runs_tests(config: pytest.Config) -> bool:
    """Return False with --collect-only, --drive-plan and the like: no test runs, and nothing is driven."""
    return not any(config.getoption(name, False) for name in _RUNS_NOTHING)


def every_test_ran(session: pytest.Session) -> bool:
    """Return True when the tests of the whole root folder, its `suites` or `robustness`, were selected and all ran.

    Only a run of every test can report a requirement that was not judged.
    """
    config = session.config
    narrowed = any(config.getoption(name, None) for name in _NARROWING)
    stopped = session.shouldstop or session.shouldfail or session.exitstatus not in (0, 1)
    wide = {config.rootpath / folder for folder in _WHOLE}
    places = {(config.invocation_params.dir / place).resolve() for place in config.args}
    return bool(wide & places) and not narrowed and not stopped


def header(options: RunOptions) -> str:
    """Return the options that decide a run's numbers, in one line. Raises `UsageError` for unknown routes."""
    seeds = ",".join(map(str, options.seeds))
    correction = "" if options.correction == "none" else f" correction={options.correction}"
    unasked = "" if options.agent_given or options.is_external else " (the default)"
    return (
        f"drive-robust: agent={options.agent}{unasked} sim={options.simulator} routes={_routes_in_words(options)} "
        f"seeds={seeds} reading={options.reading} metrics={options.metrics}{correction}"
    )


def _routes_in_words(options: RunOptions) -> str:
    """Return the number of routes and their spec; only the spec when the number is not known here."""
    if options.is_external:
        return options.routes if options.routes_given else f"all of {options.simulator}"
    if options.simulator == DEFAULT_SIMULATOR:
        return f"{len(resolve_routes(options.routes))} ({options.routes})"
    try:
        simulator = default_registry().simulator(options.simulator)
    except UsageError:  # collection reports the error, unless a conftest.py below registers the name
        return options.routes
    spec = default_spec(options.routes, simulator, given=options.routes_given)
    return f"{len(routes_of(spec, simulator))} ({spec})"
