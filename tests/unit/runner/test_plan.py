from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.metrics.table import Metric
from pytest_drive_robust.perturbations import InferenceLatency, Perturbation, Setting
from pytest_drive_robust.runner.plan import Scope, first_of_each_agent, keys_of, routes_in_order
from pytest_drive_robust.testing import fake_route
from pytest_drive_robust.verdict.object_form import requirement
from pytest_drive_robust.verdict.requirement import Requirement

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


def many(agent="driver"):
    return Scope(agent, "many", tuple(fake_route(str(number)) for number in range(40)), (0,))


def test_a_reading_goes_through_the_routes_in_planned_order_clean_first():
    scope, wanted = many(), requirement("RD", LATENCY) <= 0.3
    plan = scope.verdict_plan(wanted, VerdictRule())
    assert plan.rule == "evidence"
    order = [route.perturbed[0].route.id for route in routes_in_order(scope, plan.need)]
    asked = [(task.route.id, task.episode.setting) for task in plan.requests(0)]
    assert asked == [(route, setting) for route in order for setting in ("clean", str(LATENCY))]
    assert plan.requests(0, 3) == plan.requests(0)[:6]
    assert keys_of(plan.requests(0, 3)) == tuple(task.key for task in plan.requests(0)[:6])


def test_a_route_is_read_with_all_of_its_seeds():
    plan = SCOPE.verdict_plan(requirement("RD", LATENCY) <= 0.3, VerdictRule())
    for route in plan.routes:
        assert len({task.route.id for task in route.requests}) == 1
        asked = [(task.episode.setting, task.episode.seed) for task in route.requests]
        assert asked == [("clean", 0), ("clean", 1), (str(LATENCY), 0), (str(LATENCY), 1)]


@pytest.mark.parametrize(("rule", "limit"), [("evidence", 0.2), ("evidence", 0.6), ("list", 0.2)])
def test_a_verdict_that_may_stop_early_likely_takes_some_of_the_routes(rule, limit):
    plan = many().verdict_plan(requirement("RD", LATENCY) <= limit, VerdictRule(rule))
    assert 5 <= plan.likely_routes <= 25
    assert plan.likely == plan.requests(0, plan.likely_routes)


def test_a_limit_that_asks_much_likely_takes_more_routes():
    takes = [
        many().verdict_plan(requirement("RD", LATENCY) <= limit, VerdictRule()).likely_routes
        for limit in (0.1, 0.3, 0.6)
    ]
    assert takes == sorted(takes, reverse=True)
    assert takes[0] > takes[-1]


def test_the_judge_of_a_plan_has_the_numbers_of_its_rule_and_only_a_degradation_has_a_floor():
    rule = VerdictRule("evidence", alpha=0.04, clean_floor=40.0, family=2)
    degradation, score = (
        many().verdict_plan(wanted, rule).judge()
        for wanted in (requirement("RD", LATENCY) <= 0.3, requirement("DS", LATENCY) >= 30)
    )
    assert (degradation.floor, score.floor) == (40.0, 0.0)
    for judge in (degradation, score):
        assert (judge.needed, judge.needed_for_fail) == pytest.approx((5 / 0.04, 5 / 0.02))


def test_a_function_over_all_episodes_is_compared_whatever_the_rule():
    metric = Metric.from_function("ticks", lambda results: float(results[0].ticks))
    plan = many().verdict_plan(Requirement(metric, LATENCY, "<=", 30.0), VerdictRule("evidence"))
    assert (plan.rule, plan.likely_routes) == ("point", 40)


def test_a_comparison_of_values_takes_all_routes():
    plan = many().verdict_plan(requirement("RD", LATENCY) <= 0.2, VerdictRule("point"))
    assert plan.likely == plan.requests(0)


def test_a_few_episodes_of_each_other_agent_come_first():
    verdict_plans = [
        many(agent).verdict_plan(requirement("DS") >= 40, VerdictRule()) for agent in ("one", "two", "two", "three")
    ]
    first = first_of_each_agent(verdict_plans)
    assert {task.episode.agent for task in first} == {"two", "three"}
    likely = {task.key for plan in verdict_plans[1:] for task in plan.likely}
    assert {task.key for task in first} <= likely
    assert first_of_each_agent([]) == ()
    other = many("two").verdict_plan(requirement("DS", LATENCY) >= 40, VerdictRule())
    assert first_of_each_agent([*verdict_plans[:2], other]) == verdict_plans[1].likely[:3]


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


def test_the_order_has_nothing_to_do_with_how_the_routes_are_named() -> None:
    def order_of(spec: str) -> list[str]:
        scope = replace(many(), routes_spec=spec)
        return [route.perturbed[0].route.id for route in routes_in_order(scope, scope.need(LATENCY, clean=False))]

    assert order_of("routes.xml") == order_of("./routes.xml") == order_of("/home/me/routes.xml")
    assert order_of("routes.xml") != sorted(order_of("routes.xml"), key=int)
