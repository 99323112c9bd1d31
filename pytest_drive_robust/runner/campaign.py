"""The episodes of one run: keeps the finished ones, has the missing ones driven, judges requirements on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import ComparisonError, DriveRobustError
from pytest_drive_robust.perturbations.base import Setting
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import (
    EpisodeRequest,
    RouteRequests,
    Scope,
    VerdictPlan,
    first_of_each_agent,
    keys_of,
)
from pytest_drive_robust.runner.scheduler import Observer, Scheduler
from pytest_drive_robust.runner.verdict_events import episodes_needed, judged, not_judged, verdict_planned
from pytest_drive_robust.stats.judges import Judge, read_until_decided
from pytest_drive_robust.stats.pace import likely_left
from pytest_drive_robust.store.base import EpisodeStore
from pytest_drive_robust.store.events import Planned, RoutesRead, Spared, Used
from pytest_drive_robust.verdict.evaluate import Verdict, evaluate
from pytest_drive_robust.verdict.requirement import Requirement

Results = tuple[EpisodeResult, ...]


@dataclass(frozen=True, slots=True)
class Judgement:
    """A verdict with the episodes behind it."""

    verdict: Verdict
    clean: Results
    perturbed: Results

    @property
    def privileged(self) -> bool:
        """True when the agent saw ground truth."""
        return any(result.privileged for result in (*self.clean, *self.perturbed))

    @property
    def episode_s(self) -> float:
        """The wall seconds of all episodes."""
        return sum(result.wall_s for result in (*self.clean, *self.perturbed))


class Campaign:
    """Answers questions about episodes; drives the episodes that are not stored yet.

    While one question waits for its episodes, free slots of the executor already drive the episodes that it will need
    next, then the episodes of later tests. Answers do not depend on that: episodes are read in planned order, whichever
    ended first.

    `budget_s`: no new episode begins later than this many seconds after the first missing episode. `whole`: all routes
    are driven, also those that a verdict does not need, because the run is compared with others: routes that were
    driven until their scores happened to be high enough say nothing about two runs. `require_unchanged` raises
    `UsageError` for an agent that may have changed since its keys were made.
    """

    def __init__(
        self,
        store: EpisodeStore,
        executor: Executor,
        observer: Observer,
        *,
        metrics: str,
        whole: bool = False,
        budget_s: float | None = None,
        require_unchanged: Callable[[str], None] = lambda agent: None,
    ) -> None:
        self._store = store
        self._first: tuple[EpisodeRequest, ...] = ()
        self.observer = observer
        self._metrics = metrics
        self._whole = whole
        self.scheduler = Scheduler(store, executor, observer, budget_s=budget_s, require_unchanged=require_unchanged)
        self._require_unchanged = require_unchanged

    def planned(
        self, requests: Mapping[str, EpisodeRequest], verdict_plans: Sequence[VerdictPlan], *, shared: bool = False
    ) -> None:
        """Note the episodes that the selected tests need, so that the observer can show how much is left.

        Idle slots may drive the episodes that the `verdict_plans` probably read, in their order. A few episodes of each
        agent come first, so that the observer knows early how long each agent's episodes take. When other processes run
        some of the tests (`shared`), idle slots drive only episodes that are needed for any verdict: those of values
        over all routes.
        """
        self.observer(Planned(tuple(requests)))
        verdict_plans = [replace(plan, rule="point") for plan in verdict_plans] if self._whole else verdict_plans
        for plan in verdict_plans:
            self.observer(verdict_planned(plan))
        if shared:
            verdict_plans = [plan for plan in verdict_plans if plan.rule == "point"]
        else:
            self._first = first_of_each_agent(verdict_plans)
        self.scheduler.plan(request for plan in verdict_plans for request in plan.likely)

    def episodes(self, scope: Scope, setting: Setting) -> Results:
        """Return every episode of `scope` under `setting`, seed by seed in route order; drive the missing ones."""
        need = scope.need(setting, clean=False)
        with self._answering(scope, setting, need) as begun:
            self._ensure_all(need, begun)
        return self._use(need.perturbed)

    def outlook(self, plan: VerdictPlan) -> tuple[int, int]:
        """Return the number of routes that the verdict probably reads, and the most that it may read; drive nothing.

        Reads stored episodes as the verdict would.
        """
        planned = len(plan.routes)
        if plan.rule == "point" or self._whole:
            return planned, planned
        judge = plan.judge()
        for number, route in enumerate(plan.routes):
            if any(self._store.get(request.key) is None for request in route.requests):
                return min(planned, number + max(1, likely_left(judge, planned))), planned
            try:
                score = self._score(plan, route)
            except ComparisonError:  # an error ends the reading, as a verdict does
                return number + 1, number + 1
            if score is not None and judge.read(*score) is not None:
                return number + 1, number + 1
        return planned, planned

    def judge(self, requirement: Requirement, scope: Scope, verdict_rule: VerdictRule, *, nodeid: str) -> Judgement:
        """Drive the missing episodes and judge the requirement; send the verdict, or any error, to the observer.

        Raises `ComparisonError` when there is no number to judge, and `UsageError` when the agent or the simulator
        cannot be made.
        """
        try:
            judgement = self.decide(requirement, scope, verdict_rule)
        except KeyboardInterrupt:  # the run itself says that it was interrupted
            raise
        except BaseException as error:  # pytest-timeout raises what is no `Exception`
            told = str(error) if isinstance(error, DriveRobustError) else f"{type(error).__name__}: {error}"
            self.observer(not_judged(requirement, scope, nodeid, told))
            raise
        self.observer(judged(judgement.verdict, scope, nodeid))
        return judgement

    def decide(self, requirement: Requirement, scope: Scope, verdict_rule: VerdictRule | None) -> Judgement:
        """Judge as `judge` does, but send no verdict: read route by route until the rule decides, or all for a value.

        `verdict_rule` None judges the value over all routes.
        """
        plan = scope.verdict_plan(requirement, verdict_rule)
        used = plan.need
        decision = planned = None
        with self._answering(scope, requirement.setting, plan.need) as begun:
            if plan.rule == "point":
                self._ensure_all(plan.need, begun)
            else:
                decision, count = self._read_routes(plan, begun)
                used, planned = RouteRequests.joined(plan.routes[:count]), len(plan.routes)
        clean, perturbed = self._use(used.clean), self._use(used.perturbed)
        verdict = evaluate(
            requirement,
            agent=scope.agent,
            clean=clean,
            perturbed=perturbed,
            mode=self._metrics,
            verdict_rule=verdict_rule,
            decision=decision,
            planned=planned,
        )
        return Judgement(verdict, clean, perturbed)

    def measure(self, requirement: Requirement, scope: Scope) -> Verdict:
        """Return a verdict with the value over all episodes, for a caller who only wants the value.

        Raises `ComparisonError` when there is no value, or when the value is meaningless: an RD whose clean driving
        score is below the floor.
        """
        verdict = self.decide(requirement, scope, None).verdict
        if verdict.reason:
            raise ComparisonError(f"{verdict.reason}. Ask for a clean floor first: 'DS under clean >= 30'.")
        return verdict

    def _ensure_all(self, need: RouteRequests, begun: list[EpisodeRequest]) -> None:
        """Drive the missing episodes of `need`, the longest first."""
        begun += need.requests
        self.scheduler.ensure(sorted(need.requests, key=self.scheduler.expected_s, reverse=True))

    def _read_routes(self, plan: VerdictPlan, begun: list[EpisodeRequest]) -> tuple[str, int]:
        """Return the decision and the number of routes read; drive the other routes if `whole`, else spare them."""
        judge = plan.judge()
        decision, count = read_until_decided(judge, self._scores(plan, judge, begun))
        rest = plan.requests(count)
        if self._whole:
            self.scheduler.ensure(rest)
            self.observer(Used(keys_of(rest)))
        elif rest:
            self.scheduler.spare(rest)
            self.observer(Spared(keys_of(rest)))
        return decision, count

    def _scores(
        self, plan: VerdictPlan, judge: Judge, begun: list[EpisodeRequest]
    ) -> Iterator[tuple[float, float] | None]:
        """Yield the scores of each route in order, while free slots drive what `judge` probably reads next."""
        planned = len(plan.routes)
        for number, route in enumerate(plan.routes):
            begun += route.requests
            likely = planned if self._whole else number + max(1, likely_left(judge, planned))
            named = {**plan.scope.named, "requirement": str(plan.requirement)}
            self.observer(RoutesRead(**named, routes=number, likely=likely))
            ahead, self._first = (*self._first, *plan.requests(number + 1, likely)), ()
            self.scheduler.ensure(route.requests, ahead, plan.requests(likely))
            yield self._score(plan, route)

    def _score(self, plan: VerdictPlan, route: RouteRequests) -> tuple[float, float] | None:
        """Return the pair of numbers that a judge reads for a route with stored episodes, None without data."""
        clean, perturbed = self._finished(route.clean), self._finished(route.perturbed)
        return plan.requirement.metric.of_route(perturbed, clean=clean, mode=self._metrics)

    def _use(self, requests: tuple[EpisodeRequest, ...]) -> Results:
        """Return the results of these requests, and note that the run uses them."""
        if requests:
            self.observer(Used(keys_of(requests)))
        return self._finished(requests)

    def _finished(self, requests: tuple[EpisodeRequest, ...]) -> Results:
        results = [(request, self._store.get(request.key)) for request in requests]
        lost = [request.episode for request, result in results if result is None]
        if lost:
            raise DriveRobustError(f"{len(lost)} episodes were driven but are not in the store, first {lost[0]}.")
        return tuple(result for _, result in results if result is not None)

    @contextmanager
    def _answering(self, scope: Scope, setting: Setting, need: RouteRequests) -> Iterator[list[EpisodeRequest]]:
        """Send the events around one question: the needed episodes before, `idle` and new store problems after.

        Yields a list, to which the body adds the episodes that it begins. When the body raises, the finished episodes
        of that list still count as used by the run, to show what led to the error or the interrupt.
        """
        self._require_unchanged(scope.agent)
        begun: list[EpisodeRequest] = []
        for event in episodes_needed(scope, setting, need):
            self.observer(event)
        try:
            yield begun
        except BaseException:
            self.observer(Used(tuple(dict.fromkeys(request.key for request in begun if self._store.get(request.key)))))
            raise
        finally:
            self.observer.idle()
            self.scheduler.tell_problems()
