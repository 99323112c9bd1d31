"""Which episode is driven next: what a verdict waits for, then what it will ask for, then what later tests need."""

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
from pytest_drive_robust.store.events import Compiling, Event, Finished, Reused, Started

_POLL_S = 0.05
"""How long to sleep at most: another process may have finished what we wait for, and the display wants to move."""


class Observer(Protocol):
    """Who follows the run: a progress display, or the journal that another process reads."""

    def __call__(self, event: Event) -> None:
        """Note that something happened."""

    def ticked(self) -> None:
        """Note that an episode is still under way. Called often: return at once."""

    def idle(self) -> None:
        """Note that nothing is under way any more, be it that all is done or that driving was interrupted."""


class _Drive(NamedTuple):
    """An episode under way."""

    request: EpisodeRequest
    future: Future[EpisodeResult]
    claim: Claim


class Scheduler:
    """Keeps every slot of an executor busy with the episodes that are needed next, none of them twice.

    An episode is claimed in the store before it begins and stored before the claim is given back: several processes
    with one store share the work without knowing of each other. `budget_s`: so many seconds after the first episode was
    missing nothing new is begun. `require_unchanged` raises `UsageError` for an agent that may be another one than when
    its keys were made: what it drove is stored under none of them. Not for several threads.
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
        self._elsewhere: set[str] = set()
        self._broken: dict[str, BaseException] = {}
        self._longest_s: dict[tuple[str, str], float] = {}
        self._compiling = (0, 0)

    def plan(self, requests: Iterable[EpisodeRequest]) -> None:
        """Note what will be asked for one day, in this order. It is driven when nothing nearer is left for a slot."""
        self._later.update((request.key, request) for request in requests if not self._is_finished(request))

    def spare(self, requests: Iterable[EpisodeRequest]) -> None:
        """Take these out of the plan."""
        for request in requests:
            self._later.pop(request.key, None)

    def ensure(
        self,
        requests: Sequence[EpisodeRequest],
        ahead: Iterable[EpisodeRequest] = (),
        rest: Iterable[EpisodeRequest] = (),
    ) -> None:
        """Return when every one of `requests` is in the store.

        Free slots begin with `ahead`, the plan, then `rest`, unless kernels are compiled that the plan waits for.

        Raises `UsageError` when the agent or the simulator of one of them cannot be made, and `BudgetSpentError` when
        one is missing and nothing new may begin.
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
                    self._begin_all(farther)  # else it keeps the compiler from its work
            elif not any(request.key in self._under_way for request in missing):
                raise BudgetSpentError(
                    f"the budget of {self._budget_s:g} s is used up and {len(missing)} of the next {len(requests)} "
                    f"episodes are missing, first {missing[0].episode}. Finished episodes are kept: run again to go on."
                )
            self._wait()

    def assist(self, requests: Iterable[EpisodeRequest]) -> None:
        """Let free slots begin with `requests`, which nobody here asks for, in their order; return soon.

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
        """Store what has come to an end since: other processes may wait for it. Returns at once."""
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
                del self._under_way[key]  # not before: who interrupts us leaves it to the next call, or to close()
            self._note_duration(request, future.result().wall_s)
            self._observer(Finished(key, future.result().wall_s))

    def expected_s(self, request: EpisodeRequest) -> float:
        """Return the wall seconds of the longest known drive of the same agent on the same route, 0 for none."""
        return self._longest_s.get((request.episode.agent, request.route.id), 0.0)

    def close(self) -> None:
        """Cut off what is under way, give back what was claimed, free the executor."""
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
        """Return whether the budget is used up; it begins when this is asked first."""
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
        """Return whether an episode is finished that was not. The disk is looked at for what others drive only."""
        return request.key in self._seen or (request.key in self._elsewhere and self._is_finished(request))

    def _begin_all(self, requests: deque[EpisodeRequest]) -> None:
        """Begin with `requests` while a slot is free. What is left stays, also what others drive at the moment."""
        passed: list[EpisodeRequest] = []  # looked at again: who drives them may be gone then
        while requests and not self._busy:
            nearest = requests.popleft()
            if not self._begin(nearest):
                passed.append(nearest)
        requests.extendleft(reversed(passed))

    def _begin(self, request: EpisodeRequest) -> bool:
        """Begin this episode where a slot is free and nobody has it.

        Return False when another process drives it, or the executor cannot yet.
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
        try:  # from here on, whatever raises: a claim that stays would be waited for to the end of this process
            self._later.pop(key, None)
            if self._store.get(key) is not None:  # finished since we looked
                claim.release()
                self._elsewhere.add(key)
                return True
            agent, setting = request.episode.agent, request.episode.setting
            self._observer(Started(key, agent, setting, request.route.label, self._executor.together(agent)))
            self._tell_compiling()  # before an executor drives, and compiles, in this thread
            self._under_way[key] = _Drive(request, self._executor.submit(request), claim)
        except BaseException:
            claim.release()
            raise
        return True

    def _wait(self) -> None:
        """Wait until something ended, but not long."""
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
        """Tell how far the executor has come with compiling, and let it be shown at once, where that changed."""
        compiling = self._executor.compiling
        if compiling != self._compiling:
            self._compiling = compiling
            self._observer(Compiling(*compiling))
            self._observer.ticked()
