from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pytest
from result_factory import make_result, trace_of

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.perturbations import Perturbation
from pytest_drive_robust.registry import registry
from pytest_drive_robust.verdict.evaluate import judge
from pytest_drive_robust.verdict.known import known_metric, metric_names
from pytest_drive_robust.verdict.parse import parse_requirement


@dataclass
class MuddyLens(Perturbation):
    """A test's own failure."""

    grams: float = 1.0
    phrase = "muddy lens {grams} g"


def mean_ticks(results: Sequence[EpisodeResult]) -> float:
    """How long the episodes were."""
    return sum(result.ticks for result in results) / len(results)


@pytest.fixture
def own_words(monkeypatch: pytest.MonkeyPatch) -> None:
    words = registry.Registry()
    words.register_metric("ticks", mean_ticks)
    words.register_perturbation(MuddyLens)
    monkeypatch.setattr(registry, "default_registry", lambda: words)


@pytest.mark.usefixtures("own_words")
def test_registered_metrics_and_perturbations_may_be_used_in_sentences() -> None:
    sentence = "ticks under muddy lens 2 g <= 50"
    requirement = parse_requirement(sentence)
    verdict = judge(
        requirement,
        agent="driver",
        clean=[],
        perturbed=[make_result(setting="muddy lens 2 g", trace=trace_of(51))],
    )

    assert str(requirement) == sentence
    assert requirement.id == "ticks-muddy-lens-2-g-le-50"
    assert not requirement.needs_clean
    assert (verdict.value, verdict.passed) == (51.0, False)
    assert metric_names() == ["RD", "DS", "SR", "efficiency", "comfort", "ticks"]


@pytest.mark.usefixtures("own_words")
def test_a_typo_in_a_registered_name_is_explained_with_it() -> None:
    with pytest.raises(RequirementError, match="Nearest valid sentence: ticks under muddy lens 2 g <= 50"):
        parse_requirement("tics under mudy lens 2 g <= 50")


def test_an_unknown_metric_is_refused_with_all_names() -> None:
    with pytest.raises(RequirementError, match=r"no metric named 'speed'.*Expected one of RD, DS, SR"):
        known_metric("speed")
