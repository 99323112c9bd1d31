"""Shrinking to the smallest setting that fails, with verdicts that may be wrong or open."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import cast

import pytest

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import ComparisonError
from pytest_drive_robust.perturbations import (
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    Setting,
    SpeedNoise,
)
from pytest_drive_robust.verdict.evaluate import Verdict
from pytest_drive_robust.verdict.object_form import requirement
from pytest_drive_robust.verdict.requirement import Requirement
from pytest_drive_robust.verdict.smallest_stack import minimal_failing, minimal_failure

STACK = Setting.of(
    PartialObservation(ratio=0.8), GpsNoise(std_m=5), SpeedNoise(mean=0.2), InferenceLatency(ms=500), FrameBlend()
)


@dataclass
class Unladdered(Perturbation):
    strength: float = 1.0
    phrase = "unladdered {strength}"


def latency_of(setting: Setting) -> float:
    return next((item.ms or 0.0 for item in setting.perturbations if isinstance(item, InferenceLatency)), 0.0)


def occluded(setting: Setting) -> bool:
    return any(isinstance(item, PartialObservation) and item.ratio >= 0.4 for item in setting.perturbations)


def test_what_is_not_to_blame_goes_and_the_rest_gets_as_mild_as_it_can() -> None:
    found = minimal_failing(STACK, lambda setting: latency_of(setting) >= 200 and occluded(setting))
    assert str(found.setting) == "occlusion 0.4 and 200 ms latency"
    assert found.given == STACK


def test_one_failure_alone_is_only_made_milder() -> None:
    assert str(minimal_failing(InferenceLatency(ms=500), lambda setting: latency_of(setting) > 120).setting) == (
        "150 ms latency"
    )


def test_a_severity_becomes_one_step_milder_where_more_is_too_mild() -> None:
    found = minimal_failing(InferenceLatency(ms=200), lambda setting: latency_of(setting) >= 150)
    assert str(found.setting) == "150 ms latency"


def test_what_does_the_same_as_the_setting_itself_is_not_driven() -> None:
    found = minimal_failing(InferenceLatency(ms=160), lambda setting: latency_of(setting) >= 150)
    assert str(found.setting) == "160 ms latency"  # 3 ticks, as 150 ms are
    assert "150 ms latency" not in dict(found.asked)


def test_an_open_verdict_keeps_what_it_was_asked_about() -> None:
    def fails(setting: Setting) -> str:
        return "fail" if setting == STACK else "inconclusive"

    found = minimal_failing(STACK, fails)
    assert found.setting == STACK
    assert {answer for _, answer in found.asked} == {"fail", "inconclusive"}


def test_no_setting_is_judged_twice() -> None:
    found = minimal_failing(STACK, lambda setting: latency_of(setting) >= 200)
    sentences = [sentence for sentence, _ in found.asked]
    assert len(sentences) == len(set(sentences))
    assert len(sentences) <= 20


def test_the_mildest_is_left_out_first() -> None:
    stack = Setting.of(SpeedNoise(mean=0.0), GpsNoise(std_m=0.5), Unladdered(), InferenceLatency(ms=500))
    asked: list[str] = []

    def fails(setting: Setting) -> bool:
        asked.append(str(setting))
        return setting == stack

    minimal_failing(stack, fails)
    assert asked[1] == "speed noise 0 and unladdered 1 and 500 ms latency"
    assert asked[4] == "speed noise 0 and GPS noise 0.5 m and 500 ms latency"


def test_one_failure_that_stands_in_a_stack_twice_is_left_out_once_at_a_time() -> None:
    noise = GpsNoise(std_m=0.5)
    found = minimal_failing(noise + noise, lambda setting: not setting.is_clean)
    assert str(found.setting) == "GPS noise 0.5 m"


def test_what_has_no_ladder_stays_as_severe_as_it_is() -> None:
    stack = Unladdered() + InferenceLatency(mode="measured") + GpsNoise(std_m=50)
    found = minimal_failing(stack, lambda setting: len(setting.perturbations) == 3)
    assert str(found.setting) == "unladdered 1 and measured latency and GPS noise 0.5 m"


def test_the_ladder_has_the_ticks_of_the_simulator() -> None:
    found = minimal_failing(InferenceLatency(ms=500), lambda setting: latency_of(setting) >= 130, dt_s=0.02)
    assert latency_of(found.setting) == 140


def test_a_setting_that_does_not_fail_cannot_be_shrunk() -> None:
    with pytest.raises(ComparisonError, match=r"GPS noise 5 m does not fail \(it is 'inconclusive'\)"):
        minimal_failing(GpsNoise(), lambda setting: "inconclusive")


def test_the_result_prints_a_test_case_that_runs() -> None:
    found = minimal_failing(STACK, lambda setting: latency_of(setting) >= 200, sentence="DS under {setting} >= 60")
    checked = []

    class Drive:
        def check(self, requirement: object) -> None:
            checked.append(str(requirement))

    namespace: dict[str, object] = {}
    exec("from pytest_drive_robust import requirements\n" + found.case, namespace)
    namespace["test_200_ms_latency"](Drive())  # type: ignore[operator]
    assert checked == ["DS under 200 ms latency >= 60"]
    assert str(found).startswith("smallest setting that fails: 200 ms latency (from occlusion 0.8 and ")


def test_what_does_not_fail_has_no_smallest_setting() -> None:
    def decide(asked: Requirement, rule: VerdictRule) -> Verdict:
        return cast("Verdict", SimpleNamespace(decision="inconclusive"))

    wanted = requirement("DS", STACK) >= 60
    assert minimal_failure(wanted, decide, verdict_rule=VerdictRule("evidence"), dt_s=0.05) is None


@pytest.mark.parametrize(("setting", "verdicts"), [(STACK, "2 verdicts"), (Setting.CLEAN, "1 verdict")])
def test_where_the_agent_fails_without_any_failure_the_smallest_setting_is_clean(setting, verdicts) -> None:
    def decide(asked: Requirement, rule: VerdictRule) -> Verdict:
        return cast("Verdict", SimpleNamespace(decision="fail"))

    wanted = requirement("DS", setting) >= 60
    found = minimal_failure(wanted, decide, verdict_rule=VerdictRule("evidence"), dt_s=0.05)
    assert found is not None
    assert found.summary == f"smallest setting that fails: clean (from {setting}, {verdicts})"
    assert 'requirements("DS under clean >= 60")' in found.case


def test_one_alpha_is_shared_by_all_that_is_asked_on_the_way() -> None:
    alphas: dict[str, float] = {}

    def decide(asked: Requirement, rule: VerdictRule) -> Verdict:
        assert str(asked.setting) not in alphas or asked.setting == STACK
        alphas[str(asked.setting)] = rule.alpha
        broken = latency_of(asked.setting) >= 200
        return cast("Verdict", SimpleNamespace(decision="fail" if broken else "pass"))

    rule = VerdictRule("evidence", alpha=0.1)
    found = minimal_failure(requirement("DS", STACK) >= 60, decide, verdict_rule=rule, dt_s=0.05)
    assert found is not None
    assert str(found.setting) == "200 ms latency"
    assert alphas.pop(str(STACK)) == 0.1
    assert set(alphas.values()) == {0.1 / (2 * 5)}
