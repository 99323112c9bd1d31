"""`latency margin >= 150 ms`: the sentence, its object, its refusals."""

from __future__ import annotations

import pytest

from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.perturbations import BUILTIN, BurstFrameDrop, InferenceLatency
from pytest_drive_robust.verdict.margin import MarginRequirement
from pytest_drive_robust.verdict.model import Requirement
from pytest_drive_robust.verdict.parse import parse_requirement, requirements


def parsed(sentence: str) -> Requirement:
    return parse_requirement(sentence, known=BUILTIN)


@pytest.mark.parametrize(
    ("sentence", "canonical", "plain"),
    [
        ("latency margin >= 150 ms", "latency margin >= 150 ms (RD <= 0.30)", "RD under 150 ms latency <= 0.30"),
        (
            "Latency margin ≥ 150ms (RD ≤ .4)",
            "latency margin >= 150 ms (RD <= 0.40)",
            "RD under 150 ms latency <= 0.40",
        ),
        (
            "burst frame drop margin >= 3 s (DS >= 60)",
            "burst frame drop margin >= 3 s (DS >= 60)",
            "DS under 3 s burst frame drop >= 60",
        ),
        ("GPS noise margin >= 5 m", "GPS noise margin >= 5 m (RD <= 0.30)", "RD under GPS noise 5 m <= 0.30"),
        ("occlusion margin >= 0.5", "occlusion margin >= 0.5 (RD <= 0.30)", "RD under occlusion 0.5 <= 0.30"),
        ("frame blend margin >= 5", "frame blend margin >= 5 (RD <= 0.30)", "RD under 5 frame blend <= 0.30"),
    ],
)
def test_a_margin_is_the_requirement_at_that_severity(sentence: str, canonical: str, plain: str) -> None:
    margin, same = parsed(sentence), parsed(plain)
    assert str(margin) == canonical
    assert parsed(canonical) == margin
    assert (margin.metric, margin.setting, margin.comparison, margin.limit) == (
        (same.metric, same.setting, same.comparison, same.limit)
    )
    assert margin != same


def test_its_test_id_says_the_same() -> None:
    assert parsed("latency margin >= 150 ms").id == "latency-margin-ge-150ms-rd-le-0.30"


def test_it_has_an_object_form() -> None:
    margin = MarginRequirement.of(BurstFrameDrop(length_s=3), "DS", ">=", 60)
    assert str(margin) == "burst frame drop margin >= 3 s (DS >= 60)"
    assert margin.perturbation == BurstFrameDrop(length_s=3)


@pytest.mark.parametrize(
    ("sentence", "message"),
    [
        ("latency margin >= 0.2 s", "has the unit 's'. Expected ms: 'latency margin >= 0.2 ms'"),
        ("latency margin >= 150", "has no unit. Expected ms: 'latency margin >= 150 ms'"),
        ("occlusion margin >= 0.5 m", "has the unit 'm'. Expected none: 'occlusion margin >= 0.5'"),
        ("latancy margin >= 150 ms", "there is no failure called 'latancy'. Did you mean 'latency'?"),
        ("latency margin >= 150 ms (XY <= 0.3)", "there is no metric named 'XY'"),
        ("latency margin >= 150 ms (RD <= 1)", "holds for every agent"),
        ("latency margin <= 150 ms", "the word 'under' is missing"),
        ("occlusion margin >= 1.5", "ratio is 1.5"),
    ],
)
def test_what_cannot_be_meant_is_refused(sentence: str, message: str) -> None:
    with pytest.raises(RequirementError) as error:
        parsed(sentence)
    assert message in str(error.value)


def test_margins_stand_beside_other_requirements() -> None:
    found = requirements("RD under 100 ms latency <= 0.2\nlatency margin >= 150 ms  # a comment", known=BUILTIN)
    assert [type(item) for item in found] == [Requirement, MarginRequirement]
    assert found[1].setting.perturbations == (InferenceLatency(ms=150),)
