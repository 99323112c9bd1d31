from __future__ import annotations

from dataclasses import dataclass, replace

from pytest_drive_robust.perturbations import InferenceLatency, Perturbation, Setting
from pytest_drive_robust.runner.plan import Scope
from pytest_drive_robust.testing import fake_route
from pytest_drive_robust.verdict.model import requirement

ROUTES = (fake_route("1"), fake_route("2"))
SCOPE = Scope("driver", "two", ROUTES, (0, 1))
LATENCY = Setting.of(InferenceLatency(ms=200))


@dataclass
class WarmingUp(Perturbation):
    warmup_ticks: int = 20
    phrase = "warming up {warmup_ticks}"


def test_a_relative_requirement_needs_the_clean_twins_first():
    plan = list(SCOPE.plan([requirement("RD", LATENCY) <= 0.3]).values())
    assert [task.episode.setting for task in plan] == ["clean"] * 4 + [str(LATENCY)] * 4
    assert [(task.episode.route_id, task.episode.seed) for task in plan[:4]] == [
        ("1", 0),
        ("2", 0),
        ("1", 1),
        ("2", 1),
    ]


def test_an_absolute_requirement_needs_no_clean_twins():
    plan = SCOPE.plan([requirement("DS", LATENCY) >= 40])
    assert {task.episode.setting for task in plan.values()} == {str(LATENCY)}


def test_requirements_share_episodes():
    wanted = [requirement("RD", LATENCY) <= 0.3, requirement("SR", LATENCY) >= 0.1, requirement("DS") >= 40]
    assert len(SCOPE.plan(wanted)) == 8


def test_routes_of_one_id_and_different_content_are_different_episodes():
    longer = replace(SCOPE, routes=(fake_route("1", length_m=80.0), ROUTES[1]))
    wanted = [requirement("DS") >= 40]
    assert len(SCOPE.plan(wanted).keys() & longer.plan(wanted).keys()) == 2


def test_keys_are_the_same_in_every_process():
    again = Scope("driver", "two", (fake_route("1"), fake_route("2")), (0, 1))
    wanted = [requirement("RD", LATENCY) <= 0.3]
    assert list(SCOPE.plan(wanted)) == list(again.plan(wanted))


def test_clean_twins_of_a_setting_with_a_warm_up_get_the_same_warm_up():
    need = SCOPE.need(Setting.of(WarmingUp(20)), clean=True)
    assert {task.setting.warmup_ticks for task in need.requests} == {20}
    assert {task.episode.setting for task in need.clean} == {str(Setting.of(WarmingUp(20)).baseline)}
    plain = SCOPE.need(LATENCY, clean=True)
    assert {task.key for task in plain.clean}.isdisjoint(task.key for task in need.clean)


def test_clean_is_its_own_twin():
    need = SCOPE.need(Setting.CLEAN, clean=True)
    assert need.clean == need.perturbed
    assert len(need.requests) == 4
