from __future__ import annotations

import pytest

from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.perturbations import InferenceLatency, PartialObservation, Setting
from pytest_drive_robust.verdict.object_form import requirement
from pytest_drive_robust.verdict.sentences import requirements

LATE = Setting.of(InferenceLatency(ms=200))


def test_the_object_form_is_the_parsed_sentence() -> None:
    built = requirement("RD", InferenceLatency(ms=200)) <= 0.30

    assert built == requirements("RD under 200 ms latency <= 0.30")[0]
    assert hash(built) == hash(requirements("RD under 200 ms latency <= 0.30")[0])
    assert str(built) == "RD under 200 ms latency <= 0.30"


def test_stacks_and_clean_have_an_object_form_too() -> None:
    stacked = requirement("RD", PartialObservation(ratio=0.5) + InferenceLatency(ms=100)) <= 0.4

    assert str(stacked) == "RD under occlusion 0.5 and 100 ms latency <= 0.40"
    assert str(requirement("DS") >= 60) == "DS under clean >= 60"
    assert str(requirement("DS", Setting.CLEAN) >= 62.5) == "DS under clean >= 62.5"


def test_the_limit_may_stand_on_the_left() -> None:
    assert (0.3 >= requirement("RD", LATE)) == (requirement("RD", LATE) <= 0.3)  # noqa: SIM300


def test_a_comparison_without_the_limit_itself_is_refused_with_the_one_to_write() -> None:
    with pytest.raises(RequirementError, match=r"'DS under clean > 60': '>' cannot be used here, write '>='"):
        requirement("DS") > 60  # noqa: B015
    with pytest.raises(RequirementError, match=r"'<' cannot be used here, write '<='"):
        requirement("RD", LATE) < 0.3  # noqa: B015


def test_asserting_what_has_no_limit_is_refused() -> None:
    with pytest.raises(RequirementError, match="has no limit yet"):
        assert requirement("RD", LATE)


@pytest.mark.parametrize("metric", [5, ["RD"], None])
def test_what_is_no_name_of_a_metric_is_refused_as_an_unknown_name(metric: object) -> None:
    with pytest.raises(RequirementError, match=r"no metric named .*Expected one of RD, DS, SR"):
        requirement(metric, LATE)  # type: ignore[arg-type]
