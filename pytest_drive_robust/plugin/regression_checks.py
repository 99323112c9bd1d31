"""Stores a finished run, compares it with another run, and reviews its waivers."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import DriveRobustError, UsageError
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.regression.comparison import compare
from pytest_drive_robust.regression.comparison_result import Comparison, Terms
from pytest_drive_robust.regression.document import snapshot_of
from pytest_drive_robust.regression.fingerprint import Fingerprint, Mismatch
from pytest_drive_robust.regression.options import RegressionOptions
from pytest_drive_robust.regression.references import BASELINES, References, project_home
from pytest_drive_robust.regression.snapshot import Snapshot
from pytest_drive_robust.regression.waivers import Waivers
from pytest_drive_robust.report.comparison import comparison_text
from pytest_drive_robust.report.run_result import RunResult
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope
from pytest_drive_robust.runner.scopes import Scopes
from pytest_drive_robust.store.events import Judged


class RegressionChecks:
    """Checks a finished run. Built before driving, so that a missing reference run costs no episode.

    Raises `UsageError` for a missing reference run, and for one of another simulator unless the options allow that.
    `comparison` is None until `finish` has compared the run, and stays None when there is no reference. `problems` are
    the reasons of `finish` for which the run was not stored or not compared.
    """

    def __init__(self, regression: RegressionOptions, options: RunOptions, waivers: Waivers) -> None:
        self._regression = regression
        self._waivers = waivers
        self._simulator, self._stuck_stop_s = options.simulator, options.stuck_stop_s
        by_id = regression.drives_all or options.report_path is not None
        self._knows_routes_by_id = by_id and not options.is_external  # results may lack what a route file tells
        self._here = Path.cwd()  # a test may change the current folder
        self._references = References(regression.home, regression.baselines)
        open_fails = options.inconclusive == "fail"
        self._terms = Terms(regression.allowances, options.verdict_rule.kind, regression.policy, open_fails)
        self._before = self._load(options.simulator) if regression.compare else None
        # the report's pages also show replays of the reference; a baseline holds scores only, so this is None
        wanted = self._before is not None and options.report_path is not None
        self.document_before = self._references.document(regression.compare) if wanted else None
        self.comparison: Comparison | None = None
        self.problems: list[str] = []
        self._reviewed: list[str] = []
        self._stored: list[str] = []

    def check_plan(self, requests: Iterable[EpisodeRequest], *, scopes: Scopes, whole: bool) -> None:
        """Raise `UsageError` when the plan shows that the comparison will be refused. `whole`: the plan is complete."""
        if self._before is not None:
            from pytest_drive_robust.regression.planned_run import check_planned_run

            def driven_with(agent: str) -> Fingerprint:
                return Fingerprint(self._simulator, self._stuck_stop_s, versions=scopes.versions_of(agent))

            check_planned_run(self._before, requests, whole=whole, driven_with=driven_with, terms=self._terms)

    def check_routes(self, scopes: Iterable[Scope]) -> None:
        """Raise `UsageError` for two routes of one id in a run that is to be stored, compared or shown in pages."""
        found: dict[str, tuple[Route, str]] = {}
        for scope in scopes if self._knows_routes_by_id else ():
            for route in scope.routes:
                other, spec = found.setdefault(route.id, (route, scope.routes_spec))
                if other != route:
                    raise UsageError(
                        f"{spec} and {scope.routes_spec} use the id {route.id!r} for two routes. Stored runs, "
                        "comparisons and pages know routes by their ids: give the routes of one file other ids, or "
                        "drive the files in two runs."
                    )

    def review_waivers(self, run: RunResult, *, whole: bool) -> list[str]:
        """Return a line for each waiver that the run concerns. `whole` says that every test was selected and ran."""
        self._reviewed = self._waivers.review(run.judged, whole=whole, open_fails=self._terms.open_fails)
        return self._reviewed

    def finish(self, run: RunResult, document_of_run: Callable[[], Mapping[str, object]]) -> bool:
        """Compare and store the run; return True when the run must not be green.

        `document_of_run` builds the document of the run, which only a comparison and a stored run need.
        """
        if not run.episodes:
            return False  # `RunOutputs` reports a run without episodes
        red = bool(run.late)
        if not self._regression.save and self._before is None:
            return red
        document = document_of_run()
        worse = self._before is not None and self._compare(self._before, document)
        if self._regression.save:
            red = self._store(document, worse=worse) or red
        return red or worse

    def sections(self, *, colour: bool, width: int) -> list[tuple[str, str]]:
        """Return (title, text) of each section for the terminal: the comparison, then stored runs and waivers."""
        told = []
        if self.comparison is not None:
            title = f"drive-robust: compared with {self.comparison.before.label}"
            told.append((title, comparison_text(self.comparison, colour=colour, width=width)))
        lines = [*self._reviewed, *self.problems, *self._stored]
        if lines:
            told.append(("drive-robust: stored runs and waivers", "\n".join(lines)))
        return told

    def is_waived(self, judged: Judged) -> bool:
        """Return whether a waiver that holds excuses a requirement that failed."""
        waiver = self._waivers.find(judged.requirement, judged.nodeid, agent=judged.agent)
        return waiver is not None and waiver.holds

    def _load(self, simulator: str) -> Snapshot:
        before = self._references.load(self._regression.compare, simulator=simulator)
        known = before.simulator
        mismatch = Mismatch("simulator", f"the simulator was {known} and is {simulator}")
        if known not in (None, simulator) and mismatch.refuses(self._regression.policy):
            raise UsageError(
                f"this run cannot be compared with {before.label}: {mismatch.text}. Give --drive-sim {known}."
            )
        return before

    def _store(self, document: Mapping[str, object], *, worse: bool) -> bool:
        """Store the run; return True when the run could not be stored. `worse` says that the comparison was red."""
        name = self._regression.save
        try:
            complete = snapshot_of(document, label="this run").is_complete
        except UsageError as error:  # two routes share an id, and tests that no plan knows asked for them
            self.problems.append(f"ERROR: the run was not stored: {error}")
            return True
        if not complete and self._holds_complete(name):
            self.problems.append(f"not stored: this run is incomplete, so the stored run {name} stays as it was")
            return True
        try:
            path = self._references.runs.save(document, name=name)
        except OSError as error:
            self.problems.append(f"ERROR: the run was not stored: {error}")
            return True
        if not complete:
            self._stored.append(f"stored as {path.stem}, incomplete: run again before you compare with it")
            return False
        self._stored.append(
            f"stored as {path.stem}; next: pytest --drive-robust --drive-compare={path.stem} or "
            f"{self._bless(path.stem)}"
        )
        compared = self._regression.compare
        if worse and self._references.takes(compared, path):
            self._stored.append(
                f"warning: the next run with --drive-compare={compared} compares with this run, and so does not show "
                "this regression again"
            )
        return False

    def _bless(self, name: str) -> str:
        """Return the command that accepts a stored run.

        The command changes to the root folder when `drive-robust` would not find the stored runs from here. The command
        names the folder of baselines when it is not the default, because `drive-robust` does not read the ini file.
        """
        home, baselines = self._regression.home, self._regression.baselines
        found = project_home(self._here).resolve() == home.resolve()
        command = ("" if found else f"cd {shlex.quote(str(home))} && ") + f'drive-robust bless {name} --reason "..."'
        return command if baselines == home / BASELINES else f"{command} --baselines {shlex.quote(str(baselines))}"

    def _holds_complete(self, name: str) -> bool:
        if name not in self._references.runs.names():
            return False
        try:
            return self._references.stored(name).is_complete
        except UsageError:  # damaged, or of another version: overwriting loses nothing
            return False

    def _compare(self, before: Snapshot, document: Mapping[str, object]) -> bool:
        try:
            self.comparison = compare(before, snapshot_of(document, label="this run"), self._terms)
        except DriveRobustError as error:
            self.problems.append(f"ERROR: not compared with {before.label}: {error}")
            return True
        return bool(self.comparison.refusals) or self.comparison.regressed
