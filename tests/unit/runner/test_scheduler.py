from __future__ import annotations

import sys
from concurrent.futures import Future
from dataclasses import replace
from inspect import getsourcelines

import pytest
from result_factory import make_result

from pytest_drive_robust.errors import BudgetSpentError, PluginError
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import Scope
from pytest_drive_robust.runner.scheduler import Scheduler
from pytest_drive_robust.store.base import MemoryStore
from pytest_drive_robust.store.claims import Claim
from pytest_drive_robust.store.events import Compiling, Finished, Reused, Started
from pytest_drive_robust.store.folder import FolderStore
from pytest_drive_robust.testing import fake_route

TASKS = (
    Scope("driver", "many", tuple(fake_route(str(number)) for number in range(8)), (0,))
    .need(Setting.CLEAN, clean=False)
    .requests
)
ROUTE_OF = {task.key: task.route.id for task in TASKS}


class Hands(Executor):
    """An executor whose episodes end when the test says so."""

    slots = 2

    def __init__(self, slots: int = 2) -> None:
        self.slots = slots
        self.begun: list[str] = []
        self.open: dict[str, Future] = {}
        self.most = 0
        self.closed = False

    def submit(self, task):
        future: Future = Future()
        self.begun.append(task.route.id)
        self.open[task.route.id] = future
        self.most = max(self.most, len(self.open))
        return future

    def finish(self, route: str) -> None:
        self.open.pop(route).set_result(make_result(route))

    def close(self) -> None:
        self.closed = True


class Diary:
    """An observer that finishes episodes whenever the scheduler waits: the newest first, the worst order."""

    def __init__(self, hands: Hands, *, finishes: bool = True) -> None:
        self.hands = hands
        self.finishes = finishes
        self.reused_routes: list[str] = []
        self.finished_routes: list[str] = []
        self.waits = 0

    def __call__(self, event) -> None:
        if isinstance(event, Finished):
            self.finished_routes.append(ROUTE_OF[event.key])
        elif isinstance(event, Reused):
            self.reused_routes.append(ROUTE_OF[event.key])

    def ticked(self) -> None:
        self.waits += 1
        if self.finishes and self.hands.open:
            self.hands.finish(list(self.hands.open)[-1])


def scheduler_of(slots: int = 2, store: MemoryStore | None = None, *, observer: type[Diary] = Diary, **given):
    hands = Hands(slots)
    diary = observer(hands)
    return Scheduler(store or MemoryStore(), hands, diary, **given), hands, diary


def test_what_is_asked_for_is_driven_and_each_episode_once():
    scheduler, hands, diary = scheduler_of()
    scheduler.ensure(TASKS)
    scheduler.ensure(TASKS)
    assert sorted(hands.begun) == [task.route.id for task in TASKS]
    assert sorted(diary.finished_routes) == sorted(hands.begun)
    assert hands.most == 2


def test_free_slots_begin_with_what_comes_next():
    scheduler, hands, _ = scheduler_of(slots=3)
    scheduler.plan(TASKS)
    scheduler.ensure(TASKS[4:5], ahead=TASKS[6:7])
    assert hands.begun[:3] == ["4", "6", "0"]  # asked for, then ahead, then the plan


def test_what_is_hardly_needed_waits_for_the_plan():
    scheduler, hands, _ = scheduler_of(slots=4)
    scheduler.plan(TASKS[:1])
    scheduler.ensure(TASKS[4:5], ahead=TASKS[6:7], rest=TASKS[7:])
    assert hands.begun[:4] == ["4", "6", "0", "7"]


def test_what_waits_for_a_compiler_is_begun_later_and_nothing_that_is_hardly_needed_meanwhile(monkeypatch):
    hands = Hands()
    other = tuple(replace(task, episode=replace(task.episode, agent="other")) for task in TASKS[4:6])
    for task in other:
        monkeypatch.setitem(ROUTE_OF, task.key, task.route.id)
    ready = {"driver"}
    hands.drives = ready.__contains__
    scheduler = Scheduler(MemoryStore(), hands, Diary(hands))
    scheduler.plan([*TASKS[:2], *other])
    scheduler.ensure(TASKS[:1], rest=TASKS[6:])
    assert hands.begun == ["0", "1"]
    ready.add("other")
    scheduler.ensure(other)
    assert hands.begun[2:4] == ["4", "5"]


def test_the_plan_leaves_out_and_tells_what_is_stored():
    store = MemoryStore()
    store.put(TASKS[0].key, make_result("0"))
    scheduler, hands, diary = scheduler_of(slots=3, store=store)
    scheduler.plan(TASKS[:2])
    assert diary.reused_routes == ["0"]
    scheduler.ensure(TASKS[5:6])
    assert hands.begun[:2] == ["5", "1"]


def test_what_was_spared_is_not_driven_for_the_plan():
    scheduler, hands, _ = scheduler_of(slots=2)
    scheduler.plan(TASKS)
    scheduler.spare(TASKS[1:])
    scheduler.ensure(TASKS[:1])
    assert hands.begun == ["0"]


def test_one_slot_drives_nothing_that_nobody_waits_for():
    scheduler, hands, _ = scheduler_of(slots=1)
    scheduler.plan(TASKS)
    scheduler.ensure(TASKS[3:4], ahead=TASKS[4:])
    assert hands.begun == ["3"]


def test_what_another_process_drives_is_waited_for_and_meanwhile_the_next_is_driven():
    store = MemoryStore()
    claims = store.claim
    taken = {TASKS[0].key}
    store.claim = lambda key: None if key in taken else claims(key)  # type: ignore[method-assign]

    class Other(Diary):
        def ticked(self) -> None:
            super().ticked()
            if self.waits == 3:
                store.put(TASKS[0].key, make_result("0"))

    scheduler, hands, diary = scheduler_of(slots=1, store=store, observer=Other)
    scheduler.ensure(TASKS[:1], ahead=TASKS[1:3])
    assert "0" not in hands.begun
    assert hands.begun[0] == "1"
    assert diary.reused_routes == ["0"]


def test_what_others_drove_and_gave_back_is_begun_in_its_order():
    store = MemoryStore()
    claims, held = store.claim, {task.key for task in TASKS[1:3]}
    store.claim = lambda key: None if key in held else claims(key)  # type: ignore[method-assign]

    class Patient(Diary):
        def ticked(self) -> None:
            held.clear()
            self.waits += 1
            if self.waits == 3:
                self.hands.finish("0")

    scheduler, hands, _ = scheduler_of(slots=4, store=store, observer=Patient)
    scheduler.ensure(TASKS[:1], ahead=TASKS[1:4])
    assert hands.begun == ["0", "3", "1", "2"]


def test_a_claim_that_becomes_free_is_taken():
    store = MemoryStore()
    claims, refusals = store.claim, iter([True, True])
    store.claim = lambda key: None if next(refusals, False) else claims(key)  # type: ignore[method-assign]
    scheduler, hands, _ = scheduler_of(slots=1, store=store)
    scheduler.ensure(TASKS[:1])
    assert hands.begun == ["0"]


def test_an_agent_that_cannot_be_made_is_told_to_who_asked_for_it_only():
    scheduler, hands, diary = scheduler_of(slots=2)
    diary.finishes = False

    def break_the_second() -> None:
        if "1" in hands.open:
            hands.open.pop("1").set_exception(PluginError("no such weights"))
        elif "0" in hands.open:
            hands.finish("0")

    diary.ticked = break_the_second  # type: ignore[method-assign]
    scheduler.ensure(TASKS[:1], ahead=TASKS[1:2])
    with pytest.raises(PluginError, match="no such weights"):
        scheduler.ensure(TASKS[1:2])


def test_after_the_budget_nothing_begins_but_what_is_under_way_ends():
    now = [0.0]
    scheduler, hands, diary = scheduler_of(slots=1, budget_s=10.0, clock=lambda: now[0])

    def late() -> None:
        now[0] += 6.0
        hands.finish(list(hands.open)[-1])

    diary.ticked = late  # type: ignore[method-assign]
    with pytest.raises(BudgetSpentError, match="2 of the next 4 episodes are missing"):
        scheduler.ensure(TASKS[:4])
    assert hands.begun == ["0", "1"]
    scheduler.ensure(TASKS[:2])  # what is there can still be read


def test_after_the_budget_what_is_under_way_and_asked_for_ends_first():
    now = [0.0]
    scheduler, hands, diary = scheduler_of(slots=2, budget_s=10.0, clock=lambda: now[0])

    def late() -> None:
        now[0] += 11.0
        hands.finish(list(hands.open)[-1])

    diary.ticked = late  # type: ignore[method-assign]
    with pytest.raises(BudgetSpentError, match="1 of the next 3 episodes are missing"):
        scheduler.ensure(TASKS[:3])
    assert diary.finished_routes == ["1", "0"]


def test_after_the_budget_nobody_waits_for_what_others_asked_for_and_nothing_begins_for_them():
    now = [0.0]
    scheduler, hands, diary = scheduler_of(slots=2, budget_s=10.0, clock=lambda: now[0])
    diary.finishes = False
    scheduler.assist(TASKS[:1])
    now[0], diary.finishes = 10.0, True
    with pytest.raises(BudgetSpentError, match="1 of the next 1 episodes are missing"):
        scheduler.ensure(TASKS[1:2])
    assert list(hands.open) == ["0"]
    diary.finishes = False
    scheduler.assist(TASKS[2:3])
    assert hands.begun == ["0"]


def test_what_broke_is_begun_again_only_when_it_is_asked_for_again():
    scheduler, hands, diary = scheduler_of(slots=2)
    broken = []

    def break_the_second() -> None:
        if "1" in hands.open:
            hands.open.pop("1").set_exception(PluginError("no such weights"))
            broken.append("1")
        elif hands.open:
            hands.finish(next(iter(hands.open)))

    diary.ticked = break_the_second  # type: ignore[method-assign]
    scheduler.ensure(TASKS[:1], ahead=TASKS[1:2])
    scheduler.ensure(TASKS[2:3], ahead=TASKS[1:2])
    assert hands.begun == ["0", "1", "2"]
    for _ in range(2):  # the one from before, then one of now
        with pytest.raises(PluginError, match="no such weights"):
            scheduler.ensure(TASKS[1:2])
    assert broken == ["1", "1"]


def test_the_longest_drive_of_a_route_tells_what_the_next_one_takes():
    several = Scope("driver", "one", (TASKS[0].route,), (0, 1)).need(Setting.CLEAN, clean=False).requests
    store = MemoryStore()
    for task, wall_s in zip(several, (5.0, 2.0), strict=True):
        store.put(task.key, replace(make_result("0"), wall_s=wall_s))
        ROUTE_OF.setdefault(task.key, "0")
    scheduler, _, _ = scheduler_of(store=store)
    assert scheduler.expected_s(several[0]) == 0.0
    scheduler.plan(several)
    assert [scheduler.expected_s(task) for task in (several[0], TASKS[1])] == [5.0, 0.0]


def test_what_was_begun_ahead_is_stored_without_being_asked_for():
    class OldestFirst(Diary):
        def ticked(self) -> None:
            self.hands.finish(next(iter(self.hands.open)))

    hands, store = Hands(), MemoryStore()
    scheduler = Scheduler(store, hands, OldestFirst(hands))
    scheduler.ensure(TASKS[:1], ahead=TASKS[1:])
    ahead = next(task for task in TASKS if task.route.id in hands.open)
    hands.finish(ahead.route.id)
    scheduler.collect()
    assert store.get(ahead.key) is not None
    assert store.claim(ahead.key) is not None
    scheduler.close()


def test_closing_gives_back_what_was_claimed():
    store = MemoryStore()
    released: list[str] = []
    claims = store.claim

    class Noted:
        def __init__(self, key: str) -> None:
            self.key, self.own = key, claims(key)

        def release(self) -> None:
            released.append(self.key)
            self.own.release()

    store.claim = Noted  # type: ignore[method-assign, assignment]
    scheduler, hands, diary = scheduler_of(slots=2, store=store)

    def interrupt() -> None:
        raise KeyboardInterrupt

    diary.ticked = interrupt  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        scheduler.ensure(TASKS)
    scheduler.close()
    assert hands.closed
    assert released == [task.key for task in TASKS[:2]]


class Compiles(Hands):
    """An executor that compiles three functions, one whenever it is asked, before an episode may end."""

    done = -2

    @property
    def compiling(self) -> tuple[int, int]:
        self.done = min(self.done + 1, 3)
        return max(0, self.done), 3


class Notes(Diary):
    """Remembers what was compiled, and how many episodes had begun."""

    def __call__(self, event) -> None:
        super().__call__(event)
        if isinstance(event, Compiling):
            self.compiled.append((event.done, event.total, len(self.hands.begun)))

    def ticked(self) -> None:
        if self.compiled[-1][0] == 3:
            super().ticked()


def test_what_is_compiled_is_told_before_the_first_episode_and_whenever_it_changes():
    hands = Compiles(slots=1)
    notes = Notes(hands)
    notes.compiled = []
    Scheduler(MemoryStore(), hands, notes).ensure(TASKS[:1])
    assert notes.compiled == [(0, 3, 0), (1, 3, 1), (2, 3, 1), (3, 3, 1)]


def test_what_another_process_finished_before_we_could_claim_it_is_not_driven_again():
    released = []

    class Given(Claim):
        def release(self) -> None:
            released.append(self)

    class Shared(MemoryStore):
        def claim(self, key):
            self.put(key, make_result(ROUTE_OF[key]))  # the other one has just given its claim back
            return Given()

    scheduler, hands, diary = scheduler_of(store=Shared())
    scheduler.ensure(TASKS[:3])
    assert hands.begun == []
    assert diary.reused_routes == ["0", "1", "2"]
    assert len(released) == 3


class FullDisk(Diary):
    """A journal that cannot write the first time that an episode begins."""

    full = True

    def __call__(self, event) -> None:
        if isinstance(event, Started) and self.full:
            self.full = False
            raise OSError(28, "No space left on device")
        super().__call__(event)


def test_an_episode_whose_beginning_could_not_be_noted_is_driven_when_it_is_asked_for_again(tmp_path):
    store = FolderStore(tmp_path)
    scheduler, hands, _ = scheduler_of(store=store, observer=FullDisk)
    with pytest.raises(OSError, match="No space left"):
        scheduler.ensure(TASKS[:1])
    with store.claim(TASKS[0].key) as claim:  # else the next test waits for this process itself
        assert claim is not None
    scheduler.ensure(TASKS[:1])
    assert hands.begun == ["0"]


def test_an_interruption_while_the_store_is_asked_under_the_claim_gives_it_back(tmp_path):
    class Interrupted(FolderStore):
        asked = 0

        def get(self, key):
            self.asked += 1
            if self.asked == 2:
                raise KeyboardInterrupt
            return super().get(key)

    store = Interrupted(tmp_path)
    scheduler, hands, _ = scheduler_of(store=store)
    with pytest.raises(KeyboardInterrupt):
        scheduler.ensure(TASKS[:1])
    with store.claim(TASKS[0].key) as claim:
        assert claim is not None
    scheduler.ensure(TASKS[:1])
    assert hands.begun == ["0"]


@pytest.mark.parametrize("line", range(2, len(getsourcelines(Scheduler.collect)[0])))
def test_an_interruption_at_any_line_of_collecting_leaves_no_claim_behind(line, tmp_path):
    store = FolderStore(tmp_path)
    scheduler, hands, diary = scheduler_of(store=store)
    diary.finishes = False
    scheduler.assist(TASKS[:1])
    hands.finish("0")
    code = Scheduler.collect.__code__

    def interrupt(frame, event, argument):
        if event == "line" and frame.f_lineno == code.co_firstlineno + line:
            raise KeyboardInterrupt
        return interrupt

    before = sys.gettrace()
    sys.settrace(lambda frame, event, argument: interrupt if frame.f_code is code else None)
    try:
        scheduler.collect()
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(before)
    scheduler.close()
    assert store.claim(TASKS[0].key) is not None
