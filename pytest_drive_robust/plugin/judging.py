"""What the fixture `drive` gives to a test: judging requirements and measuring metrics on episodes of its routes."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

import pytest

from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import DriveRobustError, UsageError
from pytest_drive_robust.metrics.episodes import require_scorable
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.ladder import ladder_of
from pytest_drive_robust.plugin.drive_marker import marker_options
from pytest_drive_robust.plugin.environment import variables_of_tests_told
from pytest_drive_robust.plugin.estimate import Estimate
from pytest_drive_robust.plugin.shown_verdicts import ShownVerdicts
from pytest_drive_robust.plugin.unjudged import ANSWERED
from pytest_drive_robust.plugin.verdict_errors import RAISED, UNANSWERED, NotJudgedError
from pytest_drive_robust.regression.waivers import Waivers
from pytest_drive_robust.runner.campaign import Campaign
from pytest_drive_robust.runner.scopes import Scopes
from pytest_drive_robust.runner.verdict_events import searched
from pytest_drive_robust.verdict.evaluate import Verdict
from pytest_drive_robust.verdict.largest_severity import Bracket, largest
from pytest_drive_robust.verdict.requirement import MarginRequirement, Requirement
from pytest_drive_robust.verdict.smallest_stack import MinimalFailure, minimal_failure
from pytest_drive_robust.verdict.touched import require_touched

ONE_AT_A_TIME = threading.RLock()
"""The lock for asking the campaign: a test may ask from several threads, the campaign answers one at a time."""

_KEPT = "Finished episodes are kept: give the test more time, or run again to go on."


class Drive:
    """The `drive` fixture: judges requirements and measures metrics for the agent, routes and seeds of this test.

    Episodes are driven when they are first asked for; every test of the run shares them. Threads of a test may ask, and
    are answered one after the other. A setting is a `Setting`, a `Perturbation` or a sentence, such as
    `"GPS noise 15 m and 200 ms latency"`. Raises `UsageError` for a marker of the test `item` that cannot be used.
    """

    def __init__(self, context: DriveContext, item: pytest.Item) -> None:
        marker = marker_options(item)
        self._context = context
        self._item = item
        self._scope = context.scopes.of(marker)
        self._verdict_rule = replace(marker.verdict_rule(context.options.verdict_rule), family=context.family)
        self._reading = marker.asked_reading(context.options.asked_reading)
        self._verdicts = ShownVerdicts(item, context.options, context.waivers, self._scope.routes_spec, self._reach)
        self._calls = 0

    @property
    def calls(self) -> int:
        """How often the test has asked for a verdict, a number or episodes."""
        return self._calls

    @property
    def was_asked(self) -> bool:
        """True once the test asked for a verdict, a number or an episode."""
        return self._calls > 0

    @property
    def agent(self) -> str:
        """The name of the agent under test."""
        return self._scope.agent

    @property
    def routes(self) -> tuple[Route, ...]:
        """The routes that are driven."""
        return self._scope.routes

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds that each route is driven with."""
        return self._scope.seeds

    def check(self, requirement: Requirement, *, verdict: str | None = None, margin: float | None = None) -> Verdict:
        """Drive the missing episodes, judge `requirement` and return the verdict.

        Fails the test when the requirement does not hold. Makes the test an error when the requirement cannot be
        judged: an episode broke in the simulator, or there is nothing to compare with. An inconclusive verdict warns,
        fails or skips, as `--drive-inconclusive` says. After a waived requirement fails, the test goes on and is an
        xfail at its end.

        `verdict` (`"auto"`, `"evidence"`, `"list"`, `"point"`) and `margin` change the rule for this requirement only.
        """
        __tracebackhide__ = True
        with self._errors_of(requirement):
            _require_requirement("check", requirement)
            rule = MarkerOptions(verdict=verdict, margin=margin).verdict_rule(self._verdict_rule)
            verdict_rule = rule.for_routes(len(self.routes))
            requirement = requirement.read_as(self._reading)
            self._context.scopes.check_setting(requirement.setting)  # one that the body of a test states
            judgement = self._context.campaign.judge(requirement, self._scope, verdict_rule, nodeid=self._item.nodeid)
            self._answered(requirement)
        self._verdicts.show(judgement)
        return judgement.verdict

    def rd(self, setting: Setting | Perturbation | str) -> Estimate:
        """Return the robustness degradation under `setting`: 0 is none, 1 is all of the clean driving score."""
        __tracebackhide__ = True
        return self._measure("RD", setting, "<=", 0.0)

    def ds(self, setting: Setting | Perturbation | str) -> Estimate:
        """Return the driving score under `setting`, 0..100."""
        __tracebackhide__ = True
        return self._measure("DS", setting, ">=", 50.0)

    def sr(self, setting: Setting | Perturbation | str) -> Estimate:
        """Return the success rate under `setting`, 0..1."""
        __tracebackhide__ = True
        return self._measure("SR", setting, ">=", 0.5)

    def episodes(self, setting: Setting | Perturbation | str, *, broken: bool = False) -> tuple[EpisodeResult, ...]:
        """Return every episode under `setting`, seed by seed in route order; missing episodes are driven first.

        Makes the test an error, as `check` does, when an episode broke in the simulator, which says nothing about the
        agent, or when the setting touched nothing, which is clean driving under another name. With `broken`, episodes
        that broke in the simulator are returned, too, for a test that looks at `outcome` itself.
        """
        __tracebackhide__ = True
        with self._errors_of(f"the episodes under {setting}"):
            asked = self._setting(setting)
            results = self._context.campaign.episodes(self._scope, asked)
            if not broken:
                require_scorable(results)
            require_touched(asked, [result for result in results if result.outcome is not Outcome.INFRA_ERROR])
            self._answered(asked)
            return results

    def largest(
        self,
        perturbation: Perturbation | type[Perturbation],
        *,
        metric: str = "RD",
        limit: float = 0.30,
        comparison: str | None = None,
        levels: Iterable[float] | None = None,
    ) -> Bracket:
        """Return the largest severity at which `metric` keeps to `limit`.

        Found by bisection over whole ticks or usual steps:
        `assert drive.largest(InferenceLatency) >= InferenceLatency(ms=150)`.

        `comparison` defaults to `"<="` for metrics where less is better, and to `">="` for all others, including a
        user's own metrics. Give an object instead of a class to keep its other severities
        (`InferenceLatency(ms=0, mode="hold")`). `levels` lists the severities to try, mildest first.
        """
        __tracebackhide__ = True
        with self._errors_of(f"the largest severity with {metric} and limit {limit}"):
            found = self._largest(perturbation, metric=metric, limit=limit, comparison=comparison, levels=levels)
            self._answered(*(Setting.of(found.ladder.at(level)) for level in found.ladder.levels))
            return found

    def _largest(
        self,
        perturbation: Perturbation | type[Perturbation],
        *,
        metric: str,
        limit: float,
        comparison: str | None,
        levels: Iterable[float] | None = None,
    ) -> Bracket:
        ladder = ladder_of(perturbation, dt_s=self._context.scopes.dt_s, levels=levels, reading=self._reading)
        for level in ladder.levels:
            self._context.scopes.check_setting(Setting.of(ladder.at(level)))
        bracket = largest(
            ladder, self._decide, routes=len(self.routes), metric=metric, limit=limit, comparison=comparison
        )
        self._context.campaign.observer(searched(bracket, self._scope, self._item.nodeid))
        self._item.user_properties.append(("drive_largest", str(bracket)))
        return bracket

    def minimal(self, requirement: Requirement) -> MinimalFailure | None:
        """Return the smallest part of the setting that still breaks the requirement, or None when nothing is broken.

        Returns `clean` as the part when the agent breaks the requirement without any perturbation.

        `failure = drive.minimal(requirement("RD", stack) <= 0.50)`, `assert failure is None, str(failure)`.

        An inconclusive verdict on the requirement itself is no pass: it warns, fails or skips, as in `check`.
        """
        __tracebackhide__ = True
        with self._errors_of(requirement):
            _require_requirement("minimal", requirement)
            requirement, dt_s = requirement.read_as(self._reading), self._context.scopes.dt_s
            self._context.scopes.check_setting(requirement.setting)
            rule = self._verdict_rule.for_routes(len(self.routes))
            judgement = self._context.campaign.decide(requirement, self._scope, rule)
            failure = minimal_failure(requirement, self._decide, verdict_rule=self._verdict_rule, dt_s=dt_s)
            self._answered(requirement)
        if judgement.verdict.decision == "inconclusive":
            self._verdicts.leave_open(judgement)
        return failure

    def _decide(self, requirement: Requirement, verdict_rule: VerdictRule) -> Verdict:
        return self._context.campaign.decide(requirement, self._scope, verdict_rule).verdict

    def _measure(self, metric: str, setting: Setting | Perturbation | str, comparison: str, limit: float) -> Estimate:
        """Return the measured value, by a requirement whose limit is unused: the test compares with its own limit."""
        __tracebackhide__ = True
        with self._errors_of(f"{metric} under {setting}"):
            requirement = Requirement(metric, self._setting(setting), comparison, limit)
            estimate = Estimate.of(self._context.campaign.measure(requirement, self._scope))
            self._answered(requirement.setting)
            return estimate

    def _setting(self, given: Setting | Perturbation | str) -> Setting:
        """Return `given` as a setting with this test's reading; a sentence is parsed first.

        Raises `UsageError` for a severity that a tick cannot show: every episode would break by it.
        """
        if isinstance(given, str):
            given = self._context.scopes.setting(given)
        setting = (given if isinstance(given, Setting) else Setting.of(given)).read_as(self._reading)
        self._context.scopes.check_setting(setting)
        return setting

    def _answered(self, *asked: Requirement | Setting) -> None:
        """Note what the test now knows: a requirement of its parameters that is not among this was not judged."""
        self._item.stash.setdefault(ANSWERED, set()).update(map(str, asked))

    @contextmanager
    def _errors_of(self, what: object) -> Iterator[None]:
        """Note an error that leaves the test without an answer; raise `NotJudgedError` in place of one of ours.

        Likewise in place of `pytest.fail`, by which pytest-timeout cuts off a test that waits for episodes. Any other
        error is raised as it is: its traceback leads to what is wrong, and an xfail may name its class.
        """
        __tracebackhide__ = True
        self._calls += 1
        try:
            with ONE_AT_A_TIME, variables_of_tests_told(self._item):
                yield
        except (Exception, pytest.fail.Exception) as error:  # whichever: there is no number to judge
            self._item.user_properties.append(("drive_verdict", "error"))
            told: BaseException = error
            if isinstance(error, pytest.fail.Exception):
                told = NotJudgedError(what, f"the test was cut off: {error} {_KEPT}")
            elif isinstance(error, DriveRobustError):
                told = NotJudgedError(what, error)
            for key in (UNANSWERED, RAISED):
                self._item.stash.setdefault(key, []).append(told)
            if told is error:
                raise
            raise told from None

    def _reach(self, requirement: Requirement) -> str:
        """Return, for a margin requirement, the largest severity that holds, or why it is unknown; else `""`."""
        if not isinstance(requirement, MarginRequirement):
            return ""
        try:
            with ONE_AT_A_TIME:
                found = self._largest(
                    requirement.perturbation,
                    metric=requirement.metric.name,
                    limit=requirement.limit,
                    comparison=requirement.comparison,
                )
        except DriveRobustError as error:  # the verdict does not depend on this search
            return f"\n  the largest severity that holds is not known: {error}"
        return f"\n  {found}"


class DriveContext(NamedTuple):
    """What a process needs in order to drive and judge.

    `family` is the number of requirements that the multiple-test correction counts, 1 without a correction. `waivers`
    are the waivers of the run.
    """

    options: RunOptions
    scopes: Scopes
    campaign: Campaign
    waivers: Waivers
    family: int = 1

    def drive_for(self, item: pytest.Item) -> Drive:
        """Return the `Drive` for the agent, routes, seeds, rule and reading of a test.

        Raises `NotJudgedError` for a marker that cannot be used. For a test that names the fixture, collection has
        refused such a marker before.
        """
        try:
            return Drive(self, item)
        except UsageError as error:
            raise NotJudgedError(item.name, error) from None


def _require_requirement(call: str, given: object) -> None:
    __tracebackhide__ = True
    if not isinstance(given, Requirement):
        raise TypeError(
            f"drive.{call} was given {given!r}, expected a Requirement: give one of the list that requirements(...) "
            "returns."
        )
