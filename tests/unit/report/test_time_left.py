"""The time left, as a run of the shipped suites says it, against when the run really ends."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from result_factory import scored

from pytest_drive_robust import Requirement, requirements
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.report.progress_state import ProgressState
from pytest_drive_robust.runner.campaign import Campaign
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope
from pytest_drive_robust.runner.planned_order import planned_order
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.base import MemoryStore
from pytest_drive_robust.store.events import Event, Finished

ROUTES = resolve_routes("one-per-scenario")
RECORDED = Path(__file__).with_name("recorded_durations.csv")
"""Driving score and wall seconds of the 660 episodes of the shipped suites, on a busy machine."""
LIMITS = {
    "expert": """
    SR under clean >= 0.85
    DS under clean >= 85
    RD under GPS noise 15 m and speed noise 0.2 <= 0.15
    RD under 100 ms latency <= 0.20
    """,
    "classical": """
    DS under clean >= 70
    RD under 1 s burst frame drop <= 0.20
    RD under 3 s burst frame drop <= 0.30
    RD under occlusion 0.5 <= 0.35
    RD under occlusion 0.8 <= 0.45
    RD under GPS noise 5 m <= 0.50
    RD under GPS noise 15 m <= 0.75
    RD under speed noise 0.5 <= 0.40
    RD under speed noise 0.2 <= 0.55
    RD under 100 ms latency <= 0.20
    RD under 200 ms latency <= 0.20
    RD under 500 ms latency <= 0.55
    """,
}
"""The limits of those suites when they were recorded: those that ship follow the world, the recording does not."""


@pytest.fixture(autouse=True)
def order_of_the_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read the routes as they were read when this was recorded: in another order other routes decide at the end."""
    monkeypatch.setattr(
        "pytest_drive_robust.runner.plan.planned_order",
        lambda ids, types, agent: planned_order(ids, types, f"{agent} on one-per-scenario"),
    )


def recorded() -> dict[tuple[str, str, str], tuple[float, float]]:
    with RECORDED.open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file)
        return {
            (row["agent"], row["setting"], row["route_id"]): (float(row["ds"]), float(row["wall_s"])) for row in rows
        }


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


class Replayed(Executor):
    """Drives what was recorded, in the time that it took, on a clock of its own.

    An agent's first episodes wait for `compile_s`. With a `width` so many are driven together: `slots` counts all of
    them, and each takes `width` times its own seconds. Everything takes `times` as long as recorded.
    """

    slots = 1

    def __init__(
        self,
        clock: Clock,
        *,
        slots: int,
        compile_s: float = 0.0,
        width: int = 1,
        times: float = 1.0,
        gap_s: float = 0.02,
    ) -> None:
        self.slots = slots
        self._clock = clock
        self._width, self._times = width, times
        self._compile_s, self._gap_s = compile_s, gap_s
        self._ready_s: dict[str, float] = {}
        self._known = recorded()
        self._ends: list[tuple[float, Future[EpisodeResult], EpisodeResult]] = []

    def submit(self, request: EpisodeRequest) -> Future[EpisodeResult]:
        ready_s = self._ready_s.setdefault(request.episode.agent, self._clock.now_s + self._compile_s)
        begins_s = max(self._clock.now_s, ready_s) + self._gap_s
        result = self.result(request)
        future: Future[EpisodeResult] = Future()
        self._ends.append((begins_s + result.wall_s * self._width, future, result))
        return future

    def result(self, request: EpisodeRequest) -> EpisodeResult:
        episode = request.episode
        ds, wall_s = self._known[episode.agent, episode.setting, episode.route_id]
        scored_one = scored(episode.route_id, ds, setting=episode.setting)
        return replace(scored_one, episode=episode, wall_s=wall_s * self._times)

    def together(self, agent: str) -> int:
        return self._width

    def work(self) -> None:
        self._ends.sort(key=lambda item: item[0])
        ends_s, future, result = self._ends.pop(0)
        self._clock.now_s = ends_s
        future.set_result(result)

    def close(self) -> None: ...


class Told:
    """What the display says after each episode: (clock, text)."""

    def __init__(self, clock: Clock) -> None:
        self.state = ProgressState(clock)
        self.clock = clock
        self.texts: list[tuple[float, str]] = []

    def __call__(self, event: Event) -> None:
        self.state.see(event)
        if isinstance(event, Finished):
            self.texts.append((self.clock.now_s, self.state.counts()))

    def ticked(self) -> None: ...

    def idle(self) -> None: ...


def suites(rule: str) -> list[tuple[Requirement, Scope, VerdictRule]]:
    return [
        (requirement, Scope(agent, "one-per-scenario", ROUTES, (0,)), VerdictRule(rule))
        for agent, limits in LIMITS.items()
        for requirement in requirements(limits)
    ]


def replay(
    tests: Iterable[tuple[Requirement, Scope, VerdictRule]],
    *,
    resumes: bool = False,
    stored_times: float | None = None,
    **pace: Any,
) -> Told:
    """What a run of these tests says; one that `resumes` finds the clean episodes in its store.

    With `stored_times` those took so many times as long as recorded, in place of as long as this run takes.
    """
    clock = Clock()
    told = Told(clock)
    executor, store = Replayed(clock, **pace), MemoryStore()
    earlier = executor if stored_times is None else Replayed(clock, slots=1, times=stored_times)
    campaign = Campaign(store, executor, told, metrics="bench2drive")
    tests = list(tests)
    requests = {key: request for item, scope, _ in tests for key, request in scope.plan([item]).items()}
    for key, request in requests.items():
        if resumes and request.episode.setting == "clean":
            store.put(key, earlier.result(request))
    campaign.planned(requests, [scope.verdict_plan(requirement, rule) for requirement, scope, rule in tests])
    for number, (requirement, scope, rule) in enumerate(tests):
        campaign.judge(requirement, scope, rule, nodeid=str(number))
    return told


def is_true(text: str, left_s: float) -> bool:
    """True when what is said is off by a factor of two at most."""
    found = re.search(r", (about|less than) ([0-9.]+) (s|min) left$", text)
    if found is None:
        return left_s == 0.0
    said_s = float(found[2]) * (60.0 if found[3] == "min" else 1.0)
    return left_s <= said_s if found[1] == "less than" else 0.5 <= said_s / left_s <= 2.0


@pytest.mark.parametrize(
    ("rule", "slots", "compile_s"),
    [
        ("evidence", 1, 0.0),
        ("evidence", 2, 0.0),
        ("evidence", 2, 30.0),
        ("evidence", 8, 0.0),
        ("list", 2, 0.0),
        ("point", 1, 0.0),
        ("point", 2, 0.0),
    ],
)
def test_after_ten_episodes_it_is_never_off_by_more_than_a_factor_of_two(
    rule: str, slots: int, compile_s: float
) -> None:
    told = replay(suites(rule), slots=slots, compile_s=compile_s)
    end_s = told.clock.now_s
    assert [(end_s - now_s, text) for now_s, text in told.texts[9:] if not is_true(text, end_s - now_s)] == []


def test_episodes_that_are_driven_together_share_their_time() -> None:
    told = replay(suites("point"), slots=16, width=8)
    end_s = told.clock.now_s
    assert [(end_s - now_s, text) for now_s, text in told.texts[15:] if not is_true(text, end_s - now_s)] == []


def test_a_run_that_goes_on_knows_what_an_episode_takes() -> None:
    told = replay(suites("point"), resumes=True, slots=2, times=8.0)
    end_s = told.clock.now_s
    assert [(end_s - now_s, text) for now_s, text in told.texts if not is_true(text, end_s - now_s)] == []


@pytest.mark.parametrize("stored_times", [0.3, 4.0])
def test_a_run_that_goes_on_at_another_speed_learns_it_from_ten_episodes(stored_times: float) -> None:
    told = replay(suites("point"), resumes=True, stored_times=stored_times, slots=2)
    end_s = told.clock.now_s
    assert [(end_s - now_s, text) for now_s, text in told.texts[9:] if not is_true(text, end_s - now_s)] == []


def test_the_expected_count_of_episodes_is_right_by_a_quarter_from_the_start() -> None:
    told = replay(suites("evidence"), slots=2)
    said = [int(re.search(r"of about (\d+)", text)[1]) for _, text in told.texts[:10]]  # type: ignore[index]
    assert all(0.75 <= count / len(told.texts) <= 1.25 for count in said)


@pytest.mark.parametrize(("slots", "most"), [(2, 1.05), (8, 1.15)])
def test_idle_slots_drive_little_that_no_verdict_takes(slots: int, most: float) -> None:
    needed = len(replay(suites("evidence"), slots=1).texts)
    assert needed < 0.45 * len(recorded())
    assert len(replay(suites("evidence"), slots=slots).texts) <= most * needed


def test_episodes_that_were_stored_are_not_left() -> None:
    clock = Clock()
    told, tests = Told(clock), suites("point")[:1]
    store = MemoryStore()
    (requirement, scope, rule) = tests[0]
    requests = scope.plan([requirement])
    for request in list(requests.values())[:40]:
        store.put(request.key, scored(request.route.id, 100.0))
    executor = Replayed(clock, slots=1)
    campaign = Campaign(store, executor, told, metrics="bench2drive")
    campaign.planned(requests, [scope.verdict_plan(requirement, rule)])
    assert told.state.counts() == "40/44 episodes"
