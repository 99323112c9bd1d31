"""The executor of lockstep in this process: what joins a batch, what is driven alone, what is refused."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from threading import Event as Gate

import pytest
from lockstep_agents import Net, bits, drive_together, task

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.driver import DRIVEN_AGAIN
from pytest_drive_robust.runner.inline_executor import InlineExecutor
from pytest_drive_robust.runner.local_executor import LocalExecutor
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.runner.scheduler import Scheduler
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.store.base import MemoryStore
from pytest_drive_robust.store.events import Event, Started
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent

made: list[FakeSimulator] = []


class Heard(list[Event]):
    """An observer that keeps what it hears."""

    def __call__(self, event: Event) -> None:
        self.append(event)

    def ticked(self) -> None: ...

    def idle(self) -> None: ...


class Unmakable(Net):
    def __init__(self) -> None:
        raise OSError("no weights")


def world(options: SimulatorOptions, *, breaks: tuple[int, ...] = ()) -> FakeSimulator:
    """The worlds with these numbers, in the order in which they are made, break in tick 5."""
    raises = RuntimeError("lost the server") if len(made) in breaks else None
    made.append(FakeSimulator(SimulatorOptions(tick_cap=150), raises=raises, raises_at=5))
    return made[-1]


@pytest.fixture
def registry() -> Registry:
    made.clear()
    registry = Registry()
    registry.register_agent("net", Net)
    registry.register_agent("net too", Net)
    registry.register_agent("unmakable", Unmakable)
    registry.register_agent("alone", lambda: ScriptedAgent([Control(throttle=1.0)]))
    registry.register_simulator("world", world)
    registry.register_simulator("breaks once", lambda options: world(options, breaks=(2,)))
    registry.register_simulator("breaks", lambda options: world(options, breaks=tuple(range(1, 20))))
    return registry


def executor(registry: Registry, simulator: str = "world") -> InlineExecutor:
    return InlineExecutor(registry, simulator=simulator, options=SimulatorOptions(), ticked=lambda: None, width=4)


def keyed(number: int, agent: str = "net") -> EpisodeRequest:
    one = task(metres=8.0 + number, seed=number, agent=agent)
    return EpisodeRequest(one.episode, one.route, one.setting, f"{agent}{number}")


def drive(driving: InlineExecutor, requests: list[EpisodeRequest]) -> list[EpisodeResult]:
    futures = [driving.submit(request) for request in requests]
    finish(driving, futures)
    return [future.result(timeout=0.0) for future in futures]


def finish(driving: InlineExecutor, futures: list[Future[EpisodeResult]]) -> None:
    assert driving.work is not None
    while not all(future.done() for future in futures):
        driving.work()
    driving.close()


def test_what_is_submitted_is_driven_in_batches(registry: Registry) -> None:
    requests = [keyed(number) for number in range(6)]
    found = drive(executor(registry), requests)
    assert {result.versions["lockstep"] for result in found} == {"4"}
    alone = drive_together(lambda: FakeSimulator(SimulatorOptions(tick_cap=150)), Net, requests, width=4)
    assert [bits(result) for result in found] == [bits(result) for result in alone]


def test_the_display_is_told_how_many_share_a_driver(registry: Registry) -> None:
    heard = Heard()
    driving = Scheduler(MemoryStore(), executor(registry), heard)
    driving.ensure([keyed(0), keyed(1, "alone")])
    driving.close()
    assert {event.agent: event.together for event in heard if isinstance(event, Started)} == {"net": 4, "alone": 1}


def test_work_returns_when_an_episode_has_ended(registry: Registry) -> None:
    driving = executor(registry)
    futures = [driving.submit(keyed(number)) for number in range(4)]
    assert driving.work is not None
    driving.work()
    assert 1 <= sum(future.done() for future in futures) < 4
    late = driving.submit(keyed(9))
    while not all(future.done() for future in (*futures, late)):
        driving.work()
    driving.work()  # nothing is left
    driving.close()


def test_an_episode_whose_world_broke_is_driven_again_alone(registry: Registry) -> None:
    requests = [keyed(number) for number in range(4)]
    found = drive(executor(registry, "breaks once"), requests)
    assert {result.outcome for result in found} & {Outcome.INFRA_ERROR, Outcome.AGENT_ERROR} == set()
    assert len(made) == 1 + 4, "one to ask the agent in, and those of the batch without the broken one, used again"


def test_a_world_that_always_breaks_ends_in_an_infra_error(registry: Registry) -> None:
    (found,) = drive(executor(registry, "breaks"), [keyed(0)])
    assert found.outcome is Outcome.INFRA_ERROR
    assert len(made) == 1 + 1 + 1 + DRIVEN_AGAIN


def test_an_agent_that_cannot_be_made_has_no_results_and_others_have(registry: Registry) -> None:
    driving = executor(registry)
    futures = [driving.submit(keyed(number, agent)) for number, agent in enumerate(("unmakable", "net", "unmakable"))]
    finish(driving, futures)
    assert isinstance(futures[0].exception(timeout=0.0), UsageError)
    assert futures[0].exception() is futures[2].exception(timeout=0.0)
    assert futures[1].result(timeout=0.0).outcome is Outcome.COMPLETED


def test_an_agent_without_act_batch_is_driven_also_when_a_batch_waits_before_it(registry: Registry) -> None:
    found = drive(executor(registry), [keyed(0), keyed(1, "alone"), keyed(2)])
    assert [result.versions.get("lockstep") for result in found] == ["4", None, "4"]


def test_an_agent_without_act_batch_takes_the_place_of_a_batch_until_it_is_collected(registry: Registry) -> None:
    driving = executor(registry)
    assert driving.slots == 4
    single = driving.submit(keyed(0, "alone"))
    assert driving.slots == 1
    assert driving.work is not None
    driving.work()
    assert single.done()
    assert driving.slots == 4
    driving.close()
    driving.close()


class Holding:
    """A driver that takes what it is given, and ends nothing before the gate is opened."""

    output = ""

    def __init__(self, gate: Gate, result: EpisodeResult) -> None:
        self.gate, self.result = gate, result
        self.live: list[EpisodeRequest] = []
        self.alone = False

    def drive(self, request: EpisodeRequest, width: int | None = None) -> EpisodeResult:
        self.alone = True
        assert self.gate.wait(timeout=60.0)
        return self.result

    def drive_batch(
        self, agent: str, take: Callable[[], EpisodeRequest | None], width: int
    ) -> Iterator[tuple[EpisodeRequest, EpisodeResult]]:
        while not self.gate.is_set():
            while len(self.live) < width and (request := take()) is not None:
                self.live.append(request)
            time.sleep(0.001)
        while self.live or (request := take()) is not None:
            yield (self.live.pop() if self.live else request), self.result

    def close(self) -> None: ...


@pytest.mark.parametrize(
    ("agents", "most"),
    [(["net"] * 3, 1), (["net"] * 6, 2), (["net"] * 7, 3), (["net"] * 24, 8), (["alone", *["net"] * 6], 3)],
)
def test_no_driver_is_idle_while_another_one_holds_a_batch(registry: Registry, agents: list[str], most: int) -> None:
    gate = Gate()
    (result,) = drive(executor(registry), [keyed(0)])
    drivers = [Holding(gate, result) for _ in range(3)]
    driving = LocalExecutor(lambda agent: drivers, threads=3, width=8, shares=lambda agent: agent == "net")
    futures = [driving.submit(keyed(number, agent)) for number, agent in enumerate(agents)]
    try:
        patience_s = time.monotonic() + 60.0
        while sum(len(driver.live) or driver.alone for driver in drivers) < len(agents):
            assert time.monotonic() < patience_s, [len(driver.live) for driver in drivers]
            time.sleep(0.001)
        assert all(driver.alone or 1 <= len(driver.live) <= most for driver in drivers)
    finally:
        gate.set()
        assert [future.result(timeout=60.0) for future in futures] == [result] * len(agents)
        driving.close()


def test_a_batch_that_could_go_on_for_ever_makes_room_for_another_agent(registry: Registry) -> None:
    driving = executor(registry)
    assert driving.work is not None
    many = [driving.submit(keyed(number)) for number in range(3)]
    other = driving.submit(keyed(20, "net too"))
    while not other.done():
        driving.work()
        assert len(many) < 40
        if sum(not future.done() for future in (*many, other)) < driving.slots:
            many.append(driving.submit(keyed(len(many))))
    finish(driving, many)


@pytest.mark.parametrize("agent", ["net", "alone"])
def test_after_a_test_that_was_interrupted_others_are_driven(registry: Registry, agent: str) -> None:
    raises = [True]

    class Interrupted(BaseException):
        """As a test that took too long is stopped."""

    def interrupting(options: SimulatorOptions) -> FakeSimulator:
        made = FakeSimulator(SimulatorOptions(tick_cap=150))
        step = made.step

        def stepped(control: Control) -> None:
            if raises and raises.pop():
                raise Interrupted
            step(control)

        made.step = stepped  # type: ignore[method-assign]
        return made

    registry.register_simulator("interrupting", interrupting)
    store = MemoryStore()
    scheduler = Scheduler(store, executor(registry, "interrupting"), Heard())
    with pytest.raises(Interrupted):
        scheduler.ensure([keyed(0, agent)])
    scheduler.ensure([keyed(1, agent)])
    scheduler.ensure([keyed(0, agent)])
    assert all(store.get(keyed(number, agent).key) is not None for number in (0, 1))
    scheduler.close()
