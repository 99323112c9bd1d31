"""Builds the one result of a run from the recorded events, and writes every report from that result."""

from __future__ import annotations

import os
from collections.abc import Callable, Container, Mapping
from dataclasses import replace
from functools import cache, partial
from importlib import metadata
from pathlib import Path
from typing import TypeVar

from pytest_drive_robust import __version__
from pytest_drive_robust.errors import from_here
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.plugin.regression_checks import RegressionChecks
from pytest_drive_robust.plugin.xdist import SharedRunRecord
from pytest_drive_robust.report.csv_file import write_csv
from pytest_drive_robust.report.github import append_step_summary
from pytest_drive_robust.report.json_file import run_as_json, write_json
from pytest_drive_robust.report.progress import Progress
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.report.terminal import run_summary
from pytest_drive_robust.store.base import EpisodeStore
from pytest_drive_robust.store.events import Event

_NOTHING_DRIVEN = (
    "NOT GREEN: --drive-robust was given but no episode was driven, so nothing was shown about the agent. "
)
SELECT_TESTS = "Select tests that use the drive fixture, or leave --drive-robust out."
WRITE_TESTS = "No test was found: name the folder of a suite, or write one with `drive-robust init`."
MEND_TESTS = "Its tests could not be collected: see the errors above."
BROKEN_TESTS = "Its tests failed before an episode was driven: see the errors above."

T = TypeVar("T")

_LIBRARIES = ("numpy", "numba", "opencv-python-headless", "highway-env", "pytest")
"""Distributions whose versions every run records, whether or not they could change its bits."""


class LocalRunRecord:
    """The record of a run in one process; as its observer, it also moves the progress display."""

    def __init__(self, progress: Progress, store: EpisodeStore) -> None:
        self.store = store
        self._progress = progress
        self._events: list[Event] = []

    def events(self) -> list[Event]:
        """Return all events so far."""
        return self._events

    def __call__(self, event: Event) -> None:
        """Record an event and show it (see `runner.scheduler.Observer`)."""
        self._events.append(event)
        self._progress.see(event)

    def ticked(self) -> None:
        """Show that an episode is still under way."""
        self._progress.refresh()

    def idle(self) -> None:
        """Pause the progress: pytest is about to write."""
        self._progress.pause()


class RunOutputs:
    """Builds the one `RunResult` and its reports. A report that breaks is named and does not stop the others."""

    def __init__(
        self,
        options: RunOptions,
        record: LocalRunRecord | SharedRunRecord,
        checks: RegressionChecks,
    ) -> None:
        self._options = options
        self._record = record
        self._checks = checks
        self._run: RunResult | None = None
        self._problems: list[str] = []
        self._page: Path | None = None
        self._notes: list[str] = []

    def note(self, sentence: str) -> None:
        """Keep a sentence for every report."""
        self._notes.append(sentence)

    def finish(
        self,
        *,
        whole: bool,
        ended_early: bool,
        stopped: tuple[str, ...],
        own_verdicts: tuple[str, ...],
        may_fail: Container[str],
        advice: str,
    ) -> bool:
        """Build the result and write the files; return True when the run must not be green although its tests passed.

        `whole` says that every test was selected and ran, `ended_early` that tests did not run or broke; `stopped` are
        the tests that their own verdict stopped, `own_verdicts` those that failed by an assert of their own. `may_fail`
        are the tests whose inconclusive requirements were expected to fail. `advice` is shown when no episode was
        driven.
        """
        run = self._attempt("the result of the run could not be put together", self._build)
        if run is None:
            return True
        late = [item for item in run.late if item.nodeid not in may_fail and not self._checks.is_waived(item)]
        run = self._run = replace(
            run,
            ended_early=ended_early or run.ended_early,
            stopped_tests=stopped,
            own_verdicts=own_verdicts,
            late=tuple(late),
        )
        if not run.episodes:
            self._problems.append(_NOTHING_DRIVEN + advice)
        review = partial(self._checks.review_waivers, run, whole=whole)
        waived = self._attempt("the waivers were not reviewed", review)
        run = replace(run, notes=(*run.notes, *(waived or ())))  # not in the terminal, which has a section for them
        document = cache(partial(run_as_json, run))  # up to three outputs read it, often none
        red = self._attempt("the run was not stored or compared", partial(self._checks.finish, run, document))
        if self._checks.problems:
            run = replace(run, notes=(*run.notes, *self._checks.problems))
            document = cache(partial(run_as_json, run))
        compared = self._checks.comparison
        self._write(self._options.json_path, lambda path: write_json(path, document(), compared))
        self._write(self._options.csv_path, lambda path: write_csv(path, run))
        self._attempt("the step summary was not written", lambda: append_step_summary(run, os.environ, compared))
        # after the comparison, which the pages show
        self._write(self._options.report_path, lambda path: self._write_pages(path, run, document()))
        return bool(red or self._problems)

    def _write(self, path: Path | None, write: Callable[[Path], None]) -> None:
        if path is not None:
            self._attempt(f"{os.fspath(path)} was not written", lambda: write(path))

    def _attempt(self, problem: str, act: Callable[[], T]) -> T | None:
        """Return the result of `act`; when `act` raises, note `problem` and return None."""
        try:
            return act()
        except Exception as error:
            self._problems.append(f"ERROR: {problem}: {_reason(error)}")
            return None

    def _write_pages(self, folder: Path, run: RunResult, document: Mapping[str, object]) -> None:
        from pytest_drive_robust.registry.registry import default_registry
        from pytest_drive_robust.report.pages.folder import write_pages  # loads jinja2
        from pytest_drive_robust.report.run_records import RunRecords

        registry, checks = default_registry(), self._checks
        other = checks.document_before
        records = RunRecords.of(document, run.episodes.get, registry, label="this run")
        before = None
        if other is not None and checks.comparison is not None:
            before = RunRecords.of(other, self._record.store.get, registry, label=checks.comparison.before.label)
        self._page = write_pages(folder, records, comparison=checks.comparison, before=before)

    def sections(self, *, colour: bool, width: int) -> list[tuple[str, str]]:
        """Return (title, text) of each terminal section after the table."""
        try:
            return self._checks.sections(colour=colour, width=width)
        except Exception as error:
            return [("drive-robust", f"the comparison could not be drawn: {_reason(error)}")]

    def text(self, *, colour: bool, width: int) -> str:
        """Return the table and the problems of the run; `""` when there is neither."""
        parts = []
        if self._run is not None:
            try:
                parts.append(run_summary(self._run, colour=colour, width=width))
            except Exception as error:
                parts.append(f"the table could not be drawn: {_reason(error)}")
        if self._page is not None:
            parts.append(f"report: {from_here(self._page)}")
        return "\n".join(part for part in (*parts, *self._problems) if part)

    def _build(self) -> RunResult:
        libraries = {name: metadata.version(name) for name in _LIBRARIES}
        versions = {"pytest-drive-robust": __version__, **libraries}
        events, notes = self._record.events(), tuple(self._notes)
        return RunResult.of(self._options, events, self._record.store.get, versions=versions, notes=notes)


def _reason(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
