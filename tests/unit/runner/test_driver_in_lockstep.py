"""Many episodes at once: each comes out as if it were alone, whatever happens to the others."""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lockstep_agents import Net, bits, drive_together, taking, task

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.outcome import Outcome
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.domain.truth import WorldState
from pytest_drive_robust.perturbations import InferenceLatency, Setting
from pytest_drive_robust.runner.driver import EpisodeDriver
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.machine import machine_facts
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.testing import FakeSimulator, ScriptedAgent

SETTINGS = ("clean", "GPS noise 0.5 m", "occlusion 0.5", "200 ms latency", "200 ms latency (mode=hold)")
SEEDS = (0, 1, 2, 901, 902, 903, 904)

_alone: dict[tuple[float, int, str], bytes] = {}


def world() -> FakeSimulator:
    return FakeSimulator(SimulatorOptions(tick_cap=150))


def alone(one: EpisodeRequest) -> bytes:
    key = (one.route.waypoints[-1].x_m, one.episode.seed, str(one.setting))
    if key not in _alone:
        _alone[key] = bits(drive_together(world, Net, [one], width=4)[0])
    return _alone[key]


tasks = st.lists(
    st.builds(
        task,
        metres=st.sampled_from([3.0, 8.0, 20.0]),
        seed=st.sampled_from(SEEDS),
        setting=st.sampled_from(SETTINGS),
    ),
    min_size=1,
    max_size=14,
)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(together=tasks, width=st.sampled_from([4, 8, 12]))
def test_in_any_order_among_any_neighbours_with_any_faults_each_episode_has_the_same_bits(
    together: list[EpisodeRequest], width: int
) -> None:
    results = drive_together(world, Net, together, width=width)
    assert [bits(result) for result in results] == [alone(one) for one in together]


@pytest.mark.parametrize("setting", SETTINGS)
def test_an_agent_whose_act_gives_the_same_bits_as_its_act_batch_drives_the_same_as_one_by_one(setting: str) -> None:
    together = [task(metres=metres, seed=seed, setting=setting) for metres in (5.0, 20.0) for seed in (1, 2, 901, 902)]
    results = drive_together(world, Net, together)
    singly = [drive_single(Net(), one) for one in together]
    assert [unworded(result) for result in results] == [unworded(result) for result in singly]


def unworded(result: EpisodeResult) -> bytes:
    """The bits without the sentence, which says `act_batch` in one case and `act` in the other."""
    return bits(replace(result, end_detail=""))


def drive_single(agent: Net, one: EpisodeRequest) -> EpisodeResult:
    return drive_episode(
        world(), agent, route=one.route, setting=one.setting, seed=one.episode.seed, agent_name=one.episode.agent
    )


def test_the_width_is_recorded_beside_the_versions_of_the_world() -> None:
    (result,) = drive_together(world, Net, [task()], width=12)
    assert result.versions.items() > {"fake": "1", "lockstep": "12", **machine_facts()}.items()


@pytest.mark.parametrize(
    ("seed", "detail"),
    [
        (901, r"act_batch raised ZeroDivisionError: no way \(.*lockstep_agents\.py:\d+ in control\)"),
        (902, "act_batch returned Control.*throttle is nan"),
        (903, "act_batch returned ZeroDivisionError: not my way"),
        (904, "reset raised OSError: no memory left"),
    ],
)
def test_only_the_guilty_episode_is_an_agent_error(seed: int, detail: str) -> None:
    together = [task(seed=number) for number in (0, 1, seed, 2)]
    results = drive_together(world, Net, together)
    assert [result.outcome is Outcome.AGENT_ERROR for result in results] == [False, False, True, False]
    assert results[2].ticks == (0 if seed == 904 else 9)
    with pytest.raises(AssertionError, match=detail):
        raise AssertionError(results[2].end_detail)


def test_an_agent_without_act_batch_is_told_so_in_every_episode() -> None:
    results = drive_together(world, lambda: ScriptedAgent([Control()]), [task(), task(seed=1)])
    assert {result.end_detail for result in results} == {"ScriptedAgent has no act_batch"}


def test_a_batch_with_too_few_answers_is_the_agents_fault() -> None:
    class Short(Net):
        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            return [Control()] * 3

    (result,) = drive_together(world, Short, [task()])
    assert result.outcome is Outcome.AGENT_ERROR
    assert result.end_detail == "act_batch returned 3 answers for 4 agents, expected one Control for each"


@pytest.mark.parametrize(("width", "sizes"), [(4, {4}), (8, {4, 8}), (12, {4, 8, 12}), (16, {4, 8, 16})])
def test_a_batch_has_one_of_a_few_sizes_and_no_agent_twice(width: int, sizes: set[int]) -> None:
    seen: Counter[tuple[int, int]] = Counter()

    class Counting(Net):
        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            seen[len(agents), len({id(agent) for agent in agents})] += 1
            return super().act_batch(agents, observations)

    hold = task(setting="200 ms latency (mode=hold)")
    drive_together(world, Counting, [hold, *(task(metres=4.0 + seed, seed=seed) for seed in range(17))], width=width)
    assert set(seen) == {(size, size) for size in sizes}


def test_the_last_episodes_pay_for_no_more_rows_than_they_need() -> None:
    asked: list[int] = []

    class Counting(Net):
        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            asked.append(len(agents))
            return super().act_batch(agents, observations)

    short = [task(metres=3.0, seed=seed) for seed in range(7)]
    drive_together(world, Counting, [task(metres=20.0), *short], width=8)
    ticks = Counter(asked)
    assert asked == sorted(asked, reverse=True)
    assert ticks[4] > ticks[8] > 0


def test_a_stand_in_that_breaks_costs_nobody_an_error() -> None:
    class Consecutive(Net):
        """Insists on seeing every tick, which a stand-in that comes later has not."""

        def reset(self, route: GlobalPlan, seed: int) -> None:
            super().reset(route, seed)
            self.ticks = itertools.count()

        def features(self, seen: Observation) -> list[float]:
            assert seen.tick == next(self.ticks), "a tick is missing"
            return super().features(seen)

    together = [task(metres=metres, seed=seed) for metres, seed in ((20.0, 0), (3.0, 1), (8.0, 2), (20.0, 2))]
    results = drive_together(world, Consecutive, together, width=4)
    assert [bits(result) for result in results] == [alone(one) for one in together]


def test_an_agent_that_writes_to_its_observation_changes_no_other_row() -> None:
    class Scribbling(Net):
        privileged = True

        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            controls = []
            for agent, seen in zip(reversed(agents), reversed(observations), strict=True):
                controls += super().act_batch([agent], [seen])
                seen.cameras["front"].pixels[:] = 0
                assert seen.truth is not None
                assert seen.truth.state.actors.any()
                seen.truth.state.actors[:] = 0.0
            return controls[::-1]

    together = [task(metres=metres, seed=seed) for metres, seed in ((20.0, 0), (3.0, 1), (8.0, 2))]
    results = drive_together(world, Scribbling, together)
    assert [bits(replace(result, privileged=False)) for result in results] == [alone(one) for one in together]


def test_what_was_in_a_batch_that_broke_is_not_used_again() -> None:
    class Spoilt(Net):
        spoilt = False

        def reset(self, route: GlobalPlan, seed: int) -> None:
            assert not self.spoilt, "used again"
            super().reset(route, seed)

        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            try:
                return super().act_batch(agents, observations)
            except ZeroDivisionError:
                for agent in agents:
                    agent.spoilt = True  # type: ignore[attr-defined]
                raise

    together = [task(seed=seed) for seed in (0, 901, 1, 901, 2, 0, 1)]
    results = drive_together(world, Spoilt, together, width=8)
    assert [result.outcome is Outcome.AGENT_ERROR for result in results] == [
        one.episode.seed == 901 for one in together
    ]
    assert {result.end_detail.partition(" (")[0] for result in results if result.outcome is Outcome.AGENT_ERROR} == {
        "act_batch raised ZeroDivisionError: no way"
    }


def test_a_world_that_breaks_takes_no_other_episode_with_it_and_is_not_used_again() -> None:
    worlds: list[FakeSimulator] = []
    closed: list[FakeSimulator] = []

    class Noted(FakeSimulator):
        def close(self) -> None:
            closed.append(self)

    def make() -> FakeSimulator:
        broken = RuntimeError("lost the server") if len(worlds) == 1 else None
        worlds.append(Noted(SimulatorOptions(tick_cap=150), raises=broken, raises_at=5))
        return worlds[-1]

    together = [task(metres=metres, seed=seed) for metres in (8.0, 20.0) for seed in range(3)]
    lockstep = EpisodeDriver(make, lambda name: Net())
    results = {id(one): result for one, result in lockstep.drive_batch("net", taking(together), 4, check=False)}
    assert [results[id(one)].outcome is Outcome.INFRA_ERROR for one in together] == [number == 1 for number in range(6)]
    innocent = [one for number, one in enumerate(together) if number != 1]
    assert [bits(results[id(one)]) for one in innocent] == [alone(one) for one in innocent]
    assert closed == [worlds[1]]
    lockstep.close()
    lockstep.close()
    assert sorted(map(id, closed)) == sorted(map(id, worlds))
    assert len(worlds) == 5


def test_tasks_are_read_when_there_is_room_for_them() -> None:
    read: list[EpisodeRequest] = []

    def reading() -> Iterator[EpisodeRequest]:
        for number in range(20):
            read.append(task(metres=3.0 if number == 2 else 20.0, seed=number % 3))
            yield read[-1]

    lockstep = EpisodeDriver(world, lambda name: Net())
    driving = lockstep.drive_batch("net", taking(reading()), 4, check=False)
    ended, _ = next(driving)
    assert ended is read[2]
    assert len(read) == 4
    driving.close()


def test_after_a_caller_that_went_away_the_same_worlds_drive_on() -> None:
    made: list[FakeSimulator] = []

    def make() -> FakeSimulator:
        made.append(world())
        return made[-1]

    lockstep = EpisodeDriver(make, lambda name: Net())
    together = [task(metres=metres, seed=seed) for metres in (3.0, 20.0) for seed in range(3)]
    driving = lockstep.drive_batch("net", taking(together), 4, check=False)
    next(driving)
    driving.close()
    assert {id(one): bits(result) for one, result in lockstep.drive_batch("net", taking(together), 4, check=False)} == {
        id(one): alone(one) for one in together
    }
    assert len(made) == 4


def test_after_an_interruption_nothing_of_that_tick_is_used_again() -> None:
    interrupted = [False]
    worlds: list[FakeSimulator] = []
    closed: list[FakeSimulator] = []

    class Noted(FakeSimulator):
        def reset(self, *given: Any, **named: Any) -> WorldState:
            assert not any(self is one for one in closed), "used again"
            return super().reset(*given, **named)

        def close(self) -> None:
            closed.append(self)

    class Interrupted(Net):
        cut = False

        def reset(self, route: GlobalPlan, seed: int) -> None:
            assert not self.cut, "used again"
            super().reset(route, seed)

        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            if not interrupted[0]:
                interrupted[0] = True
                for agent in agents:
                    agent.cut = True  # type: ignore[attr-defined]
                raise KeyboardInterrupt
            return super().act_batch(agents, observations)

    def make() -> FakeSimulator:
        worlds.append(Noted(SimulatorOptions(tick_cap=150)))
        return worlds[-1]

    lockstep = EpisodeDriver(make, lambda name: Interrupted())
    together = [task(seed=seed) for seed in range(3)]
    with pytest.raises(KeyboardInterrupt):
        list(lockstep.drive_batch("net", taking(together), 4, check=False))
    assert closed == worlds
    results = {id(one): bits(result) for one, result in lockstep.drive_batch("net", taking(together), 4, check=False)}
    assert results == {id(one): alone(one) for one in together}


def test_a_setting_that_measures_inference_is_driven_alone_by_act() -> None:
    class Alone(Net):
        def act(self, observation: Observation) -> Control:
            return Control(throttle=1.0)

    measured, clean = drive_together(
        world, Alone, [task(setting=str(Setting.of(InferenceLatency(mode="measured")))), task()]
    )
    assert measured.inference_s
    assert measured.trace.column("throttle").max() == 1.0
    assert ("lockstep" in measured.versions, clean.versions["lockstep"]) == (False, "8")


def test_the_wall_time_of_an_episode_is_its_share() -> None:
    slept: list[float] = []

    class Slow(Net):
        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            started_s = time.perf_counter()
            time.sleep(0.002)
            slept.append(time.perf_counter() - started_s)
            return super().act_batch(agents, observations)

    began_s = time.perf_counter()
    results = drive_together(world, Slow, [task(metres=3.0, seed=seed) for seed in range(3)])
    lasted_s = time.perf_counter() - began_s
    assert sum(slept) <= sum(result.wall_s for result in results) <= lasted_s


def test_ctrl_c_goes_through() -> None:
    class Interrupted(Net):
        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        drive_together(world, Interrupted, [task()])


@pytest.mark.parametrize("width", [-4, 0, 1, 2, 6, 10])
def test_widths_that_do_not_agree_to_the_bit_are_refused(width: int) -> None:
    with pytest.raises(ValueError, match=rf"the width of lockstep is {width}, expected a multiple of 4 such as 8"):
        drive_together(world, Net, [task()], width=width)


def test_two_agents_cannot_share_a_batch() -> None:
    with pytest.raises(ValueError, match="cannot share a batch with episodes of net"):
        drive_together(world, Net, [task(), task(agent="other")])


class Phases(Watch):
    """Notes whose code runs, and the ticks that were driven."""

    def __init__(self) -> None:
        self.seen: list[tuple[str, int]] = []
        self.ticks: list[int] = []

    def ticked(self, tick: int, *_: object) -> None:
        self.ticks.append(tick)

    def phase(self, name: str, tick: int) -> None:
        self.seen.append((name, tick))

    def inside(self, name: str) -> Callable[[], None]:
        def check() -> None:
            assert self.seen[-1][0] == name

        return check


def test_a_watch_knows_whose_code_runs() -> None:
    watch = Phases()
    in_reset, in_act, in_sim = watch.inside("reset"), watch.inside("act"), watch.inside("sim")

    class Agent(Net):
        def reset(self, route: GlobalPlan, seed: int) -> None:
            in_reset()
            super().reset(route, seed)

        @classmethod
        def act_batch(cls, agents: Sequence[Net], observations: Sequence[Observation]) -> list[Control]:
            in_act()
            return super().act_batch(agents, observations)

    class World(FakeSimulator):
        def observe(self) -> Observation:
            in_sim()
            return super().observe()

        def step(self, control: Control):  # type: ignore[no-untyped-def]
            in_sim()
            return super().step(control)

    one = task(metres=3.0)
    single = drive_episode(
        World(), Agent(), route=one.route, setting=one.setting, seed=0, agent_name="net", watch=watch
    )
    assert single.outcome is Outcome.COMPLETED, single.end_detail
    asked = [tick for name, tick in watch.seen if name == "act"]
    assert asked == [0, *range(single.ticks)]  # after its first answer it is asked for its plan: this one has none
    watch.seen.clear()
    lockstep = EpisodeDriver(World, lambda name: Agent(), watch=watch)
    ((_, result),) = lockstep.drive_batch("net", taking([one]), check=False)
    assert result.outcome is Outcome.COMPLETED, result.end_detail
    assert [tick for name, tick in watch.seen if name == "act"] == asked
    assert watch.seen[-1][0] == "sim"


def test_every_tick_of_every_episode_is_told() -> None:
    watch = Phases()
    lockstep = EpisodeDriver(world, lambda name: Net(), watch=watch)
    measured = task(metres=3.0, setting=str(Setting.of(InferenceLatency(mode="measured"))))
    together = [*(task(metres=3.0, seed=seed) for seed in range(3)), measured]
    results = [result for _, result in lockstep.drive_batch("net", taking(together), 4, check=False)]
    assert sorted(watch.ticks) == sorted(tick for result in results for tick in range(result.ticks))
