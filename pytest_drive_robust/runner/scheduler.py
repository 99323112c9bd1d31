"""Chooses the next episode: first what a verdict waits for, then what it will need, then what later tests need."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import NamedTuple, Protocol

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import BudgetSpentError, UsageError
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.store.base import EpisodeStore
from pytest_drive_robust.store.claims import Claim
from pytest_drive_robust.store.events import Compiling, Event, Finished, Reused, Started, StoreTroubled

_POLL_S = 0.05
"""Longest sleep in seconds: another process may finish an episode that we wait for, and the display must move."""


class Observer(Protocol):
    """Follows the run: a progress display, or the journal that another process reads."""

    def __call__(self, event: Event) -> None:
        """Note an event."""

    def ticked(self) -> None:
        """Note that an episode is still under way. Called often: return at once."""

    def idle(self) -> None:
        """Note that no episode is under way any more: all are done, or driving was interrupted."""


class _Drive(NamedTuple):
    """An episode under way."""

    request: EpisodeRequest
    future: Future[EpisodeResult]
    claim: Claim


class Scheduler:
    """Keeps every slot of an executor busy with the episodes that are needed next, none of them twice.

    An episode is claimed in the store before it begins, and stored before the claim is released: several processes
    share one store and the work without knowing each other. `budget_s`: no episode begins later than this many seconds
    after the first missing episode. `require_unchanged` raises `UsageError` for an agent that may have changed since
    its keys were made; its results are not stored. A scheduler serves one thread.
    """

    def __init__(
        self,
        store: EpisodeStore,
        executor: Executor,
        observer: Observer,
        *,
        budget_s: float | None = None,
        require_unchanged: Callable[[str], None] = lambda agent: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._store = store
        self._executor = executor
        self._observer = observer
        self._budget_s = budget_s
        self._require_unchanged = require_unchanged
        self._clock = clock
        self._ends_s: float | None = None
        self._later: dict[str, EpisodeRequest] = {}
        self._under_way: dict[str, _Drive] = {}
        self._seen: set[str] = set()
        self._told: set[str] = set()
        self._elsewhere: set[str] = set()
        self._broken: dict[str, BaseException] = {}
        self._longest_s: dict[tuple[str, str], float] = {}
        self._compiling = (0, 0)

    def plan(self, requests: Iterable[EpisodeRequest]) -> None:
        """Add episodes that later tests need, in this order. Free slots drive them when no nearer episode is left."""
        self._later.update((request.key, request) for request in requests if not self._is_finished(request))

    def spare(self, requests: Iterable[EpisodeRequest]) -> None:
        """Remove episodes from the plan."""
        for request in requests:
            self._later.pop(request.key, None)

    def ensure(
        self,
        requests: Sequence[EpisodeRequest],
        ahead: Iterable[EpisodeRequest] = (),
        rest: Iterable[EpisodeRequest] = (),
    ) -> None:
        """Drive the missing episodes of `requests`; return when all are in the store.

        Free slots drive `ahead`, then the plan, then `rest`. `rest` waits while kernels are compiled for the plan.

        Raises `UsageError` when the agent or the simulator of a request cannot be made, and `BudgetSpentError` when an
        episode is missing and the budget allows no new one.
        """
        nearer, farther = deque(ahead), deque(rest)
        missing = [request for request in requests if not self._is_finished(request)]
        while True:
            self.collect()
            missing = [request for request in missing if not self._has_come(request)]
            for request in missing:
                if request.key in self._broken:
                    raise self._broken.pop(request.key)
            if not missing:
                return
            if not self._is_spent():
                for request in missing:
                    self._begin(request)
                self._begin_all(nearer)
                self._begin_all(deque(self._later.values()))
                drives, later = self._executor.drives, self._later.values()
                if not self._busy and all(drives(request.episode.agent) for request in later):
                    self._begin_all(farther)  # else `rest` would slow the compiler down
            elif not any(request.key in self._under_way for request in missing):
                raise BudgetSpentError(
                    f"the budget of {self._budget_s:g} s is used up and {len(missing)} of the next {len(requests)} "
                    f"episodes are missing, first {missing[0].episode}. Finished episodes are kept: run again to go on."
                )
            self._wait()

    def assist(self, requests: Iterable[EpisodeRequest]) -> None:
        """Let free slots begin `requests`, which another process needs, in their order; return soon.

        To be called again and again. Raises `UsageError` when no process for an episode can be made at all.
        """
        self.collect()
        for request in () if self._is_spent() else requests:
            if self._busy:
                break
            if request.key not in self._under_way and self._store.get(request.key) is None:
                self._begin(request)
        self._wait()

    def collect(self) -> None:
        """Store the episodes that have ended, because other processes may wait for them; return at once."""
        for key, (request, future, claim) in tuple(self._under_way.items()):
            if not future.done():
                continue
            try:
                if future.cancelled():  # the test that drove it in this process was interrupted
                    continue
                error = future.exception() or self._change_of(request.episode.agent)
                if error is not None:
                    self._broken[key] = error
                    continue
                self._store.put(key, future.result())
                self._seen.add(key)
            finally:
                claim.release()
                del self._under_way[key]  # last: after an interrupt the next call, or close(), repeats this
            self._note_duration(request, future.result().wall_s)
            self._observer(Finished(key, future.result().wall_s))
            self.tell_problems()  # now: what a full disk does not keep is lost when the run is killed

    def tell_problems(self) -> None:
        """Send the new problems of the store to the observer."""
        for problem in self._store.problems():
            if problem not in self._told:
                self._told.add(problem)
                self._observer(StoreTroubled(problem))

    def expected_s(self, request: EpisodeRequest) -> float:
        """Return the wall seconds of the longest known drive of the same agent on the same route, 0 for none."""
        return self._longest_s.get((request.episode.agent, request.route.id), 0.0)

    def close(self) -> None:
        """Cut off the episodes under way, release their claims, and close the executor."""
        self.collect()
        self._executor.close()
        for drive in self._under_way.values():
            drive.claim.release()
        self._under_way.clear()

    def _change_of(self, agent: str) -> UsageError | None:
        try:
            self._require_unchanged(agent)
        except UsageError as error:
            return error
        return None

    def _note_duration(self, request: EpisodeRequest, wall_s: float) -> None:
        self._longest_s[request.episode.agent, request.route.id] = max(wall_s, self.expected_s(request))

    @property
    def _busy(self) -> bool:
        return len(self._under_way) >= self._executor.slots

    def _is_spent(self) -> bool:
        """Return whether the budget is used up. The budget starts with the first call."""
        if self._ends_s is None and self._budget_s is not None:
            self._ends_s = self._clock() + self._budget_s
        return self._ends_s is not None and self._clock() >= self._ends_s

    def _is_finished(self, request: EpisodeRequest) -> bool:
        if request.key in self._seen:
            return True
        stored = None if request.key in self._under_way else self._store.get(request.key)
        if stored is None:
            return False
        self._seen.add(request.key)
        self._later.pop(request.key, None)
        self._note_duration(request, stored.wall_s)
        self._observer(Reused(request.key, stored.wall_s))
        return True

    def _has_come(self, request: EpisodeRequest) -> bool:
        """Return whether a missing episode is finished now. Reads the disk only for an episode of another process."""
        return request.key in self._seen or (request.key in self._elsewhere and self._is_finished(request))

    def _begin_all(self, requests: deque[EpisodeRequest]) -> None:
        """Begin `requests` while a slot is free. Requests that did not begin stay in the queue."""
        passed: list[EpisodeRequest] = []  # tried again later: the process that drives them may be gone then
        while requests and not self._busy:
            nearest = requests.popleft()
            if not self._begin(nearest):
                passed.append(nearest)
        requests.extendleft(reversed(passed))

    def _begin(self, request: EpisodeRequest) -> bool:
        """Begin an episode if a slot is free and no process drives it.

        Returns False when another process drives the episode, or when the executor cannot drive its agent yet.
        """
        key = request.key
        if self._busy or key in self._under_way or key in self._seen or key in self._broken:
            return True
        if not self._executor.drives(request.episode.agent):
            return False
        claim = self._store.claim(key)
        if claim is None:
            self._elsewhere.add(key)
            return False
        try:  # release the claim after any error: others would wait for it as long as this process lives
            self._later.pop(key, None)
            if self._store.get(key) is not None:  # finished since we looked
                claim.release()
                self._elsewhere.add(key)
                return True
            agent, setting = request.episode.agent, request.episode.setting
            self._observer(Started(key, agent, setting, request.route.label, self._executor.together(agent)))
            self._tell_compiling()  # before an inline executor compiles and drives in this thread
            self._under_way[key] = _Drive(request, self._executor.submit(request), claim)
        except BaseException:
            claim.release()
            raise
        return True

    def _wait(self) -> None:
        """Wait until an episode ends, for a short time at most."""
        if self._under_way and self._executor.work is not None:
            self._executor.work()
        elif self._under_way:
            futures = [drive.future for drive in self._under_way.values()]
            wait(futures, timeout=_POLL_S, return_when=FIRST_COMPLETED)
        else:
            time.sleep(_POLL_S)
        self._tell_compiling()
        self._observer.ticked()

    def _tell_compiling(self) -> None:
        """Send the executor's progress in compiling to the observer when it changed, and show it at once."""
        compiling = self._executor.compiling
        if compiling != self._compiling:
            self._compiling = compiling
            self._observer(Compiling(*compiling))
            self._observer.ticked()
