"""The episodes of one run: keeps the finished ones, has the missing ones driven, judges requirements on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, cast

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import ComparisonError, DriveRobustError
from pytest_drive_robust.runner.plan import RouteRequests, routes_in_order
from pytest_drive_robust.runner.record import asked, judged, not_judged
from pytest_drive_robust.runner.scheduler import Observer, Scheduler
from pytest_drive_robust.stats.judges import VerdictKind, read_until_decided
from pytest_drive_robust.store.events import Event, Planned, Spared, Troubled, Used
from pytest_drive_robust.verdict.evaluate import evaluate

if TYPE_CHECKING:
    from pytest_drive_robust.domain.verdict_rule import VerdictRule
    from pytest_drive_robust.perturbations.base import Setting
    from pytest_drive_robust.runner.executors import Executor
    from pytest_drive_robust.runner.plan import EpisodeRequest, Need, Scope
    from pytest_drive_robust.store.base import EpisodeStore
    from pytest_drive_robust.verdict.evaluate import Verdict
    from pytest_drive_robust.verdict.requirement import Requirement

__all__ = ["Campaign", "CampaignObserver", "Judgement"]

Results = tuple[EpisodeResult, ...]


class CampaignObserver(Observer, Protocol):
    """Who follows the run, and is told when it waits for nothing."""

    def idle(self) -> None:
        """No episode is under way any more, be it that all are done or that driving was interrupted."""
        ...


@dataclass(frozen=True, slots=True)
class Judgement:
    """A verdict with what else people ask about it: `episode_s` are the wall seconds of all episodes behind it."""

    verdict: Verdict
    privileged: bool
    episode_s: float


class Campaign:
    """Answers questions about episodes; has those driven that nobody has driven yet.

    While one question waits for its episodes, free slots of the executor already drive what it will ask for next, then
    what later tests need. Answers do not depend on that: episodes are read in planned order, whoever ended first.

    `budget_s`: so many seconds after the first question no new episode is begun.
    `whole`: episodes that a verdict can do without are driven too, because the run is compared with others: routes
    that were driven until their scores happened to be high enough say nothing about two runs.
    """

    def __init__(
        self,
        store: EpisodeStore,
        executor: Executor,
        observer: CampaignObserver,
        *,
        metrics: str,
        whole: bool = False,
        budget_s: float | None = None,
    ) -> None:
        self._store = store
        self._told: set[str] = set()
        self._observer = observer
        self._metrics = metrics
        self._whole = whole
        self._scheduler = Scheduler(store, executor, observer, budget_s=budget_s)

    def planned(self, requests: Mapping[str, EpisodeRequest], *, ahead: bool = True) -> None:
        """What the selected tests are known to need, so that the observer can say how much is left.

        `ahead`: idle slots may begin with it, in this order.
        """
        self._observer(Planned(tuple(requests)))
        if ahead:
            self._scheduler.plan(requests.values())

    def episodes(self, scope: Scope, setting: Setting) -> Results:
        """Return every episode of `scope` under `setting`, routes within seeds."""
        return self._results(scope, scope.need(setting, clean=False))[1]

    def judge(self, requirement: Requirement, scope: Scope, verdict_rule: VerdictRule, *, nodeid: str) -> Judgement:
        """Drive what is missing and judge, for the record of the run.

        Raises `ComparisonError` when there is no number to judge and `UsageError` when the agent or the simulator
        cannot be made; the record says so too.
        """
        try:
            judgement = self.decide(requirement, scope, verdict_rule)
        except DriveRobustError as error:
            self._observer(not_judged(requirement, scope, nodeid, str(error)))
            raise
        self._observer(judged(judgement.verdict, scope, nodeid))
        return judgement

    def decide(self, requirement: Requirement, scope: Scope, verdict_rule: VerdictRule) -> Judgement:
        """Read route by route until `verdict_rule` decides; all where it compares values. Record no verdict."""
        need = scope.need(requirement.setting, clean=requirement.needs_clean)
        if not requirement.reads_routes(verdict_rule):
            clean, perturbed = self._results(scope, need)
            return self._judgement(requirement, scope, clean, perturbed, verdict_rule)
        self._tell_asked(scope, need)
        routes = routes_in_order(scope, need)
        begun: list[EpisodeRequest] = []
        with self._driving(begun):
            decision, count = read_until_decided(
                cast("VerdictKind", verdict_rule.kind),
                requirement.linear_forms(verdict_rule),
                self._scores(requirement, routes, begun),
                planned=len(routes),
                alpha=verdict_rule.alpha,
                fail_alpha=verdict_rule.fail_alpha,
            )
            self._leave(tuple(request for route in routes[count:] for request in route.requests))
        clean = self._use(tuple(request for route in routes[:count] for request in route.clean))
        perturbed = self._use(tuple(request for route in routes[:count] for request in route.perturbed))
        return self._judgement(
            requirement, scope, clean, perturbed, verdict_rule, decision=decision, planned=len(routes)
        )

    def measure(self, requirement: Requirement, scope: Scope) -> Verdict:
        """Return the value over all episodes, for a caller who only wants the value.

        Raises `ComparisonError` when there is none, and when it says nothing: an RD below the floor of the clean score.
        """
        clean, perturbed = self._results(scope, scope.need(requirement.setting, clean=requirement.needs_clean))
        verdict = self._judgement(requirement, scope, clean, perturbed).verdict
        if verdict.reason:
            raise ComparisonError(f"{verdict.reason}. Ask for a clean floor first: 'DS under clean >= 30'.")
        return verdict

    def assist(self, requests: Iterable[EpisodeRequest]) -> None:
        """Drive some of `requests` for others who ask for them; see `Scheduler.assist`."""
        self._scheduler.assist(requests)

    def tell(self, event: Event) -> None:
        """Put something into the record of the run that no episode tells."""
        self._observer(event)

    def close(self) -> None:
        """Cut off what is still under way and free simulators, agents and processes."""
        self._scheduler.close()

    def _results(self, scope: Scope, need: Need) -> tuple[Results, Results]:
        """Return the clean and the perturbed results, driven where missing."""
        self._tell_asked(scope, need)
        with self._driving(need.requests):
            self._ensure(
                sorted(need.requests, key=self._scheduler.expected_s, reverse=True)
            )  # all are needed: no long one last
        return self._use(need.clean), self._use(need.perturbed)

    def _judgement(
        self,
        requirement: Requirement,
        scope: Scope,
        clean: Results,
        perturbed: Results,
        verdict_rule: VerdictRule | None = None,
        *,
        decision: str | None = None,
        planned: int | None = None,
    ) -> Judgement:
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
        used = (*clean, *perturbed)
        return Judgement(verdict, any(item.privileged for item in used), sum(item.wall_s for item in used))

    def _tell_asked(self, scope: Scope, need: Need) -> None:
        for event in asked(scope, need):
            self._observer(event)

    def _scores(
        self, requirement: Requirement, routes: Sequence[RouteRequests], begun: list[EpisodeRequest]
    ) -> Iterator[tuple[float, float] | None]:
        """Yield the scores of one route after the other, while free slots drive the routes behind it.

        `begun` gets every request that was asked for.
        """
        order = [request for route in routes for request in route.requests]
        place = {request.key: number for number, request in enumerate(order)}
        for route in routes:
            begun.extend(route.requests)
            behind = range(place[route.requests[-1].key] + 1, len(order))
            self._ensure(route.requests, (order[number] for number in behind))
            clean, perturbed = self._finished(route.clean), self._finished(route.perturbed)
            yield requirement.metric.of_route(perturbed, clean=clean, mode=self._metrics)

    def _leave(self, rest: tuple[EpisodeRequest, ...]) -> None:
        """Deal with the episodes that the verdict did without."""
        if self._whole:
            self._ensure(rest)
            self._observer(Used(tuple(request.key for request in rest)))
        elif rest:
            self._scheduler.spare(rest)
            self._observer(Spared(tuple(request.key for request in rest)))

    def _ensure(self, requests: Sequence[EpisodeRequest], ahead: Iterable[EpisodeRequest] = ()) -> None:
        unique = tuple({request.key: request for request in requests}.values())
        self._scheduler.ensure(unique, ahead)

    def _use(self, requests: tuple[EpisodeRequest, ...]) -> Results:
        """Return the results of these requests, which the run now rests on."""
        if requests:
            self._observer(Used(tuple(request.key for request in requests)))
        return self._finished(requests)

    def _finished(self, requests: tuple[EpisodeRequest, ...]) -> Results:
        results = {request.key: self._store.get(request.key) for request in requests}
        lost = [request.episode for request in requests if results[request.key] is None]
        if lost:
            raise DriveRobustError(f"{len(lost)} episodes were driven but are not in the store, first {lost[0]}.")
        return tuple(result for request in requests if (result := results[request.key]) is not None)

    @contextmanager
    def _driving(self, requests: Sequence[EpisodeRequest]) -> Iterator[None]:
        """Around everything that waits for episodes: afterwards the display is gone, whatever happened.

        When no verdict comes of it, those of `requests` that are finished belong to the run all the same: an error or
        an interrupt is to be read beside what led to it.
        """
        try:
            yield
        except BaseException:
            self._observer(
                Used(tuple(dict.fromkeys(request.key for request in requests if self._store.get(request.key))))
            )
            raise
        finally:
            self._observer.idle()
            for problem in self._store.problems():
                if problem not in self._told:
                    self._told.add(problem)
                    self._observer(Troubled(problem))
