"""The episodes of one run: keeps the finished ones, has the missing ones driven, judges requirements on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import DriveRobustError
from pytest_drive_robust.runner.scheduler import Scheduler
from pytest_drive_robust.store.events import (
    Asked,
    Event,
    Finished,
    Identified,
    Judged,
    Planned,
    Reused,
    Spared,
    Started,
    Troubled,
    Used,
)

if TYPE_CHECKING:
    from pytest_drive_robust.domain.ruling import Ruling
    from pytest_drive_robust.perturbations.setting import Setting
    from pytest_drive_robust.runner.executors import Executor
    from pytest_drive_robust.runner.plan import EpisodeRequest, Need, Scope
    from pytest_drive_robust.runner.reading import Drive, RouteTasks
    from pytest_drive_robust.store.base import EpisodeStore
    from pytest_drive_robust.verdict.evaluate import Verdict
    from pytest_drive_robust.verdict.model import Requirement

__all__ = ["Campaign", "Judgement", "Observer"]

Results = tuple[EpisodeResult, ...]


class Observer(Protocol):
    """Who follows the run: a progress display, or the journal that another process reads."""

    def __call__(self, event: Event) -> None:
        """Something happened."""
        ...

    def ticked(self) -> None:
        """An episode is still under way. Called every tick."""
        ...

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
        observer: Observer,
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
        self._longest_s: dict[tuple[str, str], float] = {}
        self._scheduler = Scheduler(store, executor, self, budget_s=budget_s)

    def planned(self, tasks: Mapping[str, EpisodeRequest], *, ahead: bool = True) -> None:
        """What the selected tests are known to need, so that the observer can say how much is left.

        `ahead`: idle slots may begin with it, in this order.
        """
        self._observer(Planned(tuple(tasks)))
        if ahead:
            self._scheduler.plan(tasks.values())

    def identified(self, facts: Iterable[Identified]) -> None:
        """Tell the record what agents and routes are made of."""
        for fact in facts:
            self._observer(fact)

    def episodes(self, scope: Scope, setting: Setting) -> Results:
        """Every episode of `scope` under `setting`, routes within seeds."""
        return self._results(scope, scope.need(setting, clean=False))[1]

    def judge(self, requirement: Requirement, scope: Scope, ruling: Ruling, *, nodeid: str) -> Judgement:
        """Drive what is missing and judge, for the record of the run.

        Raises `ComparisonError` when there is no number to judge and `UsageError` when the agent or the simulator
        cannot be made; the record says so too.
        """
        try:
            judgement = self.decide(requirement, scope, ruling)
        except DriveRobustError as error:
            self._observer(_judged(requirement, scope, nodeid, verdict=None, message=str(error)))
            raise
        self._observer(_judged(requirement, scope, nodeid, verdict=judgement.verdict))
        return judgement

    def decide(self, requirement: Requirement, scope: Scope, ruling: Ruling) -> Judgement:
        """Read route by route until the ruling decides; all of them where it compares values. No verdict recorded."""
        from pytest_drive_robust.runner.reading import read_until_decided, routes_in_order
        from pytest_drive_robust.verdict.evaluate import judge
        from pytest_drive_robust.verdict.ruling import reads_routes

        if not reads_routes(requirement, ruling):
            return self.measure(requirement, scope, ruling)
        need = scope.need(requirement.setting, clean=requirement.needs_clean)
        self._tell_asked(scope, need)
        routes = routes_in_order(scope, need)
        asked: list[EpisodeRequest] = []
        with self._driving(), self._kept_in_view(asked):
            reader = self._reader(routes, asked)
            decision, count = read_until_decided(requirement, ruling, routes, reader, mode=self._metrics)
            read, rest = routes[:count], tuple(task for route in routes[count:] for task in route.tasks)
            if self._whole:
                self._ensure(rest)
                self._observer(Used(tuple(task.key for task in rest)))
            elif rest:
                self._scheduler.spare(rest)
                self._observer(Spared(tuple(task.key for task in rest)))
        clean = self._use(tuple(task for route in read for task in route.clean))
        perturbed = self._use(tuple(task for route in read for task in route.perturbed))
        verdict = judge(
            requirement, agent=scope.agent, clean=clean, perturbed=perturbed, mode=self._metrics, ruling=ruling,
            decision=decision, planned=len(routes),
        )  # fmt: skip
        return _judgement(verdict, (*clean, *perturbed))

    def measure(self, requirement: Requirement, scope: Scope, ruling: Ruling | None = None) -> Judgement:
        """The value over all episodes, compared with the limit: for a caller who only wants the value."""
        from pytest_drive_robust.verdict.evaluate import judge

        clean, perturbed = self._results(scope, scope.need(requirement.setting, clean=requirement.needs_clean))
        verdict = judge(
            requirement, agent=scope.agent, clean=clean, perturbed=perturbed, mode=self._metrics, ruling=ruling
        )
        return _judgement(verdict, (*clean, *perturbed))

    def assist(self, tasks: Iterable[EpisodeRequest]) -> None:
        """Drive some of `tasks` for others who ask for them; see `Scheduler.assist`."""
        self._scheduler.assist(tasks)

    def tell(self, event: Event) -> None:
        """Put something into the record of the run that no episode tells."""
        self._observer(event)

    def close(self) -> None:
        """Cut off what is still under way and free simulators, agents and processes."""
        self._scheduler.close()

    def _results(self, scope: Scope, need: Need) -> tuple[Results, Results]:
        """The clean and the perturbed results, driven where missing."""
        self._tell_asked(scope, need)
        with self._driving(), self._kept_in_view(need.tasks):
            self._ensure(sorted(need.tasks, key=self._expected_s, reverse=True))  # all are needed: no long one last
        return self._use(need.clean), self._use(need.perturbed)

    def _expected_s(self, task: EpisodeRequest) -> float:
        """Wall seconds of the longest drive so far of the same agent on the same route, be it in an earlier run."""
        return self._longest_s.get((task.episode.agent, task.route.id), 0.0)

    def _saw(self, task: EpisodeRequest, wall_s: float) -> None:
        place = task.episode.agent, task.route.id
        self._longest_s[place] = max(wall_s, self._longest_s.get(place, 0.0))

    def _tell_asked(self, scope: Scope, need: Need) -> None:
        for asked in _asked(scope, need):
            self._observer(asked)

    @contextmanager
    def _kept_in_view(self, tasks: Sequence[EpisodeRequest]) -> Iterator[None]:
        """When no verdict comes of it, those of `tasks` that are finished belong to the run all the same: an error or
        an interrupt is to be read beside what led to it."""
        try:
            yield
        except BaseException:
            self._observer(Used(tuple(dict.fromkeys(task.key for task in tasks if self._store.get(task.key)))))
            raise

    def _reader(self, routes: Sequence[RouteTasks], asked: list[EpisodeRequest]) -> Drive:
        """What gives the results of one route after the other, while free slots drive the routes behind it.

        `asked` gets every task that was asked for.
        """
        order = [task for route in routes for task in route.tasks]
        place = {task.key: number for number, task in enumerate(order)}

        def read(tasks: tuple[EpisodeRequest, ...]) -> Results:
            if tasks:
                asked.extend(tasks)
                behind = range(place[tasks[-1].key] + 1, len(order))
                self._ensure(tasks, (order[number] for number in behind))
            return self._finished(tasks)

        return read

    def _ensure(self, tasks: Sequence[EpisodeRequest], ahead: Iterable[EpisodeRequest] = ()) -> None:
        unique = tuple({task.key: task for task in tasks}.values())
        self._scheduler.ensure(unique, ahead)

    def _use(self, tasks: tuple[EpisodeRequest, ...]) -> Results:
        """The results of these tasks, which the run now rests on."""
        if tasks:
            self._observer(Used(tuple(task.key for task in tasks)))
        return self._finished(tasks)

    def _finished(self, tasks: tuple[EpisodeRequest, ...]) -> Results:
        results = {task.key: self._store.get(task.key) for task in tasks}
        lost = [task.episode for task in tasks if results[task.key] is None]
        if lost:
            raise DriveRobustError(f"{len(lost)} episodes were driven but are not in the store, first {lost[0]}.")
        return tuple(result for task in tasks if (result := results[task.key]) is not None)

    @contextmanager
    def _driving(self) -> Iterator[None]:
        """Around everything that waits for episodes: afterwards the display is gone, whatever happened."""
        try:
            yield
        finally:
            self._observer.idle()
            for problem in self._store.problems():
                if problem not in self._told:
                    self._told.add(problem)
                    self._observer(Troubled(problem))

    def started(self, task: EpisodeRequest) -> None:
        """An episode begins (see `runner.scheduler.Listener`)."""
        self._observer(Started(task.key, task.episode.agent, task.episode.setting, task.route.label))

    def finished(self, task: EpisodeRequest, result: EpisodeResult) -> None:
        """An episode is in the store (see `runner.scheduler.Listener`)."""
        self._saw(task, result.wall_s)
        self._observer(Finished(task.key, result.wall_s))

    def reused(self, task: EpisodeRequest) -> None:
        """An episode was in the store already (see `runner.scheduler.Listener`)."""
        stored = self._store.get(task.key)
        if stored is not None:
            self._saw(task, stored.wall_s)
        self._observer(Reused(task.key))

    def ticked(self) -> None:
        """An episode is still under way (see `runner.scheduler.Listener`)."""
        self._observer.ticked()


def _asked(scope: Scope, need: Need) -> tuple[Asked, ...]:
    """What the record is told: the setting, and its clean twins as a setting of their own."""
    clean_keys = tuple(task.key for task in need.clean)
    keys = tuple(task.key for task in need.perturbed)

    def asked(tasks: tuple[EpisodeRequest, ...], setting: str, twins: tuple[str, ...]) -> Asked:
        own = tuple(task.key for task in tasks)
        return Asked(scope.agent, scope.routes_spec, setting, scope.seeds, own, twins)

    perturbed = asked(need.perturbed, str(need.setting), () if clean_keys == keys else clean_keys)
    if not clean_keys or clean_keys == keys:
        return (perturbed,)
    return (asked(need.clean, str(need.setting.baseline), ()), perturbed)


def _judged(
    requirement: Requirement, scope: Scope, nodeid: str, *, verdict: Verdict | None, message: str = ""
) -> Judged:
    return Judged(
        nodeid=nodeid,
        requirement=str(requirement),
        agent=scope.agent,
        routes_spec=scope.routes_spec,
        seeds=scope.seeds,
        metric=requirement.metric,
        setting=str(requirement.setting),
        comparison=requirement.comparison,
        limit=float(requirement.limit),
        verdict="error" if verdict is None else verdict.decision,
        value=None if verdict is None else float(verdict.value),
        low=None if verdict is None else float(verdict.low),
        high=None if verdict is None else float(verdict.high),
        routes=0 if verdict is None else verdict.routes,
        message=message or ("" if verdict is None else verdict.reason),
        planned=0 if verdict is None else verdict.planned,
        rule="" if verdict is None else verdict.ruling.kind,
        p_value=None if verdict is None else verdict.p_value,
        family=1 if verdict is None else verdict.ruling.family,
    )


def _judgement(verdict: Verdict, used: Results) -> Judgement:
    return Judgement(verdict, any(item.privileged for item in used), sum(item.wall_s for item in used))
