"""Plans the episodes of the selected tests, and checks their names, after collection and before driving."""

from __future__ import annotations

import gc
from dataclasses import replace
from functools import partial

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.plugin.drive_marker import marker_options, named_by_all
from pytest_drive_robust.plugin.environment import keep_environment
from pytest_drive_robust.plugin.fixtures import DRIVE_CONTEXT, uses_drive
from pytest_drive_robust.plugin.judging import DriveContext
from pytest_drive_robust.plugin.process_roles import is_worker, worker_output
from pytest_drive_robust.plugin.regression_checks import RegressionChecks
from pytest_drive_robust.plugin.requirement_place import requirements_of
from pytest_drive_robust.plugin.skip_marks import is_skipped
from pytest_drive_robust.plugin.usage_errors import note_problem, problems_of
from pytest_drive_robust.registry.plugins import plugin_words
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope, VerdictPlan
from pytest_drive_robust.store.events import Advised, NamesRegistered
from pytest_drive_robust.verdict.requirement import by_evidence

DESELECTED = "drive_robust_deselected"
"""Key in a worker's output: True when tests were deselected in the worker's collection."""


class CollectionPlugin:
    """Plans the episodes of the selected tests, in every process that runs tests.

    `requests` holds these episodes by key, `verdict_plans` the episodes that each verdict reads, in the order of tests.
    `unplanned` are the tests that name in their bodies what they drive.
    """

    def __init__(self, checks: RegressionChecks) -> None:
        self._checks = checks
        self.requests: dict[str, EpisodeRequest] = {}
        self.verdict_plans: list[VerdictPlan] = []
        self.unplanned: list[str] = []
        self._advice: dict[tuple[int, float, float], str] = {}  # by number of routes, margin and alpha
        self._advice_on_scopes: list[str] = []
        self._scopes: dict[tuple[str, str], Scope] = {}
        self._judged_by_evidence = 0

    def pytest_deselected(self, items: list[pytest.Item]) -> None:
        """Tell the controller, from a worker, that tests were deselected."""
        for item in items[:1]:
            if is_worker(item.config):
                worker_output(item.config)[DESELECTED] = True

    @pytest.hookimpl(tryfirst=True)  # and registered later than plugin.hooks, so called before its refusal
    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Check the names that the run and each test use, and tell how many episodes the selected tests need."""
        config = session.config
        if problems_of(config):
            return
        context = _with_all_plugins(config)
        if not context.options.is_external:  # the official evaluator starts its agents itself
            keep_environment(config)
        # the agent of a test that is not run may be missing on this machine
        driving = [item for item in session.items if uses_drive(item) and not is_skipped(item)]
        note_problem(config, "", lambda: context.scopes.check(named_by_all(driving)))
        for item in driving:
            note_problem(config, item.nodeid, partial(self._add, context, item))
        if context.options.correction != "none":
            context = context._replace(family=max(1, self._judged_by_evidence))
            config.stash[DRIVE_CONTEXT] = context
        context.campaign.planned(self.requests, self.verdict_plans, shared=is_worker(config))
        note_problem(config, "", lambda: context.scopes.check_requests(self.requests.values()))
        note_problem(config, "", lambda: self._checks.check_routes(self._scopes.values()))
        self.unplanned += [item.nodeid for item in driving if not requirements_of(item)]
        whole = not self.unplanned
        note_problem(
            config, "", lambda: self._checks.check_plan(self.requests.values(), scopes=context.scopes, whole=whole)
        )
        self._advice_on_scopes = context.scopes.advice()
        if is_worker(config) and self._advised:
            context.campaign.observer(Advised(self._advised))  # the controller shows it
        note_problem(config, "", lambda: self._identify(context))
        gc.freeze()  # what is loaded by now stays: pytest collects garbage twice at its end, and need not look at it

    def pytest_report_collectionfinish(self) -> list[str]:
        """Return advice lines: first what the scopes leave unjudged, then what this number of routes cannot show.

        The second kind is one sentence, about the first metric, because all metrics resolve alike.
        """
        return [f"drive-robust: {text}" for text in self._advised]

    @property
    def _advised(self) -> tuple[str, ...]:
        return (*self._advice_on_scopes, *self._advice.values())

    def _identify(self, context: DriveContext) -> None:
        """Send the identity of each agent and route set to the run's record."""
        for scope in self._scopes.values():
            context.campaign.observer(context.scopes.identify(scope))

    def _add(self, context: DriveContext, item: pytest.Item) -> None:
        """Add the episodes of one test. Raises `UsageError` when the test has too few routes for its rule."""
        marker = marker_options(item)
        scope = context.scopes.of(marker)
        self._scopes.setdefault((scope.agent, scope.routes_spec), scope)
        reading = marker.asked_reading(context.options.asked_reading)
        wanted = [stated.read_as(reading) for stated in requirements_of(item).values()]
        verdict_rule = marker.verdict_rule(context.options.verdict_rule).for_routes(len(scope.routes))
        for requirement in wanted:
            context.scopes.check_setting(requirement.setting)
            advice = requirement.advice(verdict_rule, len(scope.routes))
            if advice.level == "refuse":
                by_list = "--drive-verdict list" if marker.verdict is None else "verdict='list' in the marker"
                raise UsageError(f"{advice.text} Or judge exactly these routes: {by_list}.")
            if advice.text:
                place = len(scope.routes), verdict_rule.margin, verdict_rule.alpha
                self._advice.setdefault(place, advice.text)
        self.requests.update(scope.plan(wanted))
        self.verdict_plans += [scope.verdict_plan(requirement, verdict_rule) for requirement in wanted]
        self._judged_by_evidence += by_evidence(wanted, verdict_rule)


def _with_all_plugins(config: pytest.Config) -> DriveContext:
    """Update the context, and the run's record, with the plugins loaded during collection; return the context."""
    context = config.stash[DRIVE_CONTEXT]
    plugins = plugin_words(config.pluginmanager)
    context = config.stash[DRIVE_CONTEXT] = context._replace(options=replace(context.options, plugins=plugins))
    context.campaign.observer(NamesRegistered(plugins))
    return context
