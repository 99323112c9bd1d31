"""What begins first, and what idle slots begin with."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

import pytest
from result_factory import make_result, scored

from pytest_drive_robust import requirements
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import ComparisonError, DriveRobustError
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.campaign import Campaign
from pytest_drive_robust.runner.executor import Executor
from pytest_drive_robust.runner.plan import EpisodeRequest, Scope
from pytest_drive_robust.store.base import MemoryStore
from pytest_drive_robust.store.events import Event
from pytest_drive_robust.testing import fake_route

SCOPE = Scope("driver", "many", tuple(fake_route(str(number)) for number in range(6)), (0,))
WALL_S = {"0": 1.0, "1": 5.0, "2": 2.0, "3": 4.0, "4": 3.0, "5": 6.0}


class Hands(Executor):
    """An executor that notes what it was given."""

    slots = 1

    def __init__(self, slots: int = 1) -> None:
        self.slots = slots
        self.begun: list[str] = []
        self.settings: list[str] = []

    def submit(self, task: EpisodeRequest) -> Future[EpisodeResult]:
        self.begun.append(task.route.id)
        self.settings.append(task.episode.setting)
        future: Future[EpisodeResult] = Future()
        future.set_result(replace(make_result(task.route.id), wall_s=WALL_S[task.route.id]))
        return future

    def close(self) -> None: ...


class Nobody:
    """Looks at nothing."""

    def __call__(self, event: Event) -> None: ...

    def ticked(self) -> None: ...

    def idle(self) -> None: ...


def campaign(store: MemoryStore) -> tuple[Campaign, Hands]:
    hands = Hands()
    return Campaign(store, hands, Nobody(), metrics="bench2drive"), hands


def test_what_took_long_clean_begins_first_under_a_setting():
    driving, hands = campaign(MemoryStore())
    driving.episodes(SCOPE, Setting.CLEAN)
    assert hands.begun == ["0", "1", "2", "3", "4", "5"]
    driving.episodes(SCOPE, Setting.parse("200 ms latency"))
    assert hands.begun[6:] == ["5", "1", "3", "4", "2", "0"]


def test_durations_of_an_earlier_run_count():
    store = MemoryStore()
    campaign(store)[0].episodes(SCOPE, Setting.CLEAN)
    driving, hands = campaign(store)
    driving.episodes(SCOPE, Setting.CLEAN)
    assert hands.begun == []
    driving.episodes(SCOPE, Setting.parse("200 ms latency"))
    assert hands.begun == ["5", "1", "3", "4", "2", "0"]


@pytest.mark.parametrize(
    ("rule", "shared", "begun_ahead"),
    [("point", False, True), ("point", True, True), ("evidence", False, True), ("evidence", True, False)],
)
def test_idle_slots_begin_with_later_tests_and_beside_others_only_with_what_is_needed_for_sure(
    rule: str, shared: bool, begun_ahead: bool
):
    hands = Hands(slots=4)
    driving = Campaign(MemoryStore(), hands, Nobody(), metrics="bench2drive")
    (wanted,) = requirements("DS under 200 ms latency >= 40")
    driving.planned(SCOPE.plan([wanted]), [SCOPE.verdict_plan(wanted, VerdictRule(rule))], shared=shared)
    driving.episodes(SCOPE, Setting.CLEAN)
    assert hands.settings[:6] == ["clean"] * 6
    assert ("200 ms latency" in hands.settings) is begun_ahead


class Answers(Executor):
    """An executor that gives made-up results."""

    slots = 1

    def __init__(self, result_of: Callable[[EpisodeRequest], EpisodeResult]) -> None:
        self._result_of = result_of

    def submit(self, task: EpisodeRequest) -> Future[EpisodeResult]:
        future: Future[EpisodeResult] = Future()
        future.set_result(self._result_of(task))
        return future

    def close(self) -> None: ...


@pytest.mark.parametrize("rule", ["list", "point"])
@pytest.mark.parametrize(("metrics", "decision", "value"), [("bench2drive", "pass", 100.0), ("fixed", "fail", 50.0)])
def test_routes_are_read_and_judged_as_the_metrics_of_the_run_count(
    rule: str, metrics: str, decision: str, value: float
):
    def half_of_them_reach_a_checkpoint(task: EpisodeRequest) -> EpisodeResult:
        return make_result(task.route.id, speed_ratios_pct=[100.0] if int(task.route.id) % 2 else [])

    (wanted,) = requirements("efficiency under clean >= 80")
    driving = Campaign(MemoryStore(), Answers(half_of_them_reach_a_checkpoint), Nobody(), metrics=metrics)
    verdict = driving.decide(wanted, SCOPE, VerdictRule(rule)).verdict
    assert (verdict.decision, verdict.value, verdict.planned) == (decision, value, 6)


def test_a_verdict_that_stopped_early_tells_how_many_routes_were_planned():
    (wanted,) = requirements("DS under clean >= 40")
    driving = Campaign(MemoryStore(), Answers(lambda task: make_result(task.route.id)), Nobody(), metrics="bench2drive")
    verdict = driving.decide(wanted, SCOPE, VerdictRule("list")).verdict
    assert (verdict.decision, verdict.routes, verdict.planned) == ("pass", 3, 6)


def test_a_degradation_below_the_floor_of_the_clean_score_is_no_value():
    driving = Campaign(
        MemoryStore(),
        Answers(lambda task: scored(task.route.id, 10.0, setting=task.episode.setting)),
        Nobody(),
        metrics="bench2drive",
    )
    (wanted,) = requirements("RD under 200 ms latency <= 0.3")
    with pytest.raises(ComparisonError, match=r"below the floor of 30: .* Ask for a clean floor first"):
        driving.measure(wanted, SCOPE)


def test_episodes_that_were_driven_and_are_not_in_the_store_are_an_error():
    class Forgetful(MemoryStore):
        def get(self, key: str) -> EpisodeResult | None:
            return None

    driving = Campaign(Forgetful(), Answers(lambda task: make_result(task.route.id)), Nobody(), metrics="bench2drive")
    with pytest.raises(DriveRobustError, match="6 episodes were driven but are not in the store, first driver on 0"):
        driving.episodes(SCOPE, Setting.CLEAN)
