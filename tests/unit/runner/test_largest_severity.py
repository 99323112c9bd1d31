"""The search for the largest severity on scores as an agent would give them."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import RequirementError
from pytest_drive_robust.perturbations import InferenceLatency
from pytest_drive_robust.perturbations.ladder import ladder_of
from pytest_drive_robust.runner.plan import Scope
from pytest_drive_robust.runner.search.largest_severity import ALPHA, largest
from pytest_drive_robust.stats.judges import judge_by
from pytest_drive_robust.testing import fake_route
from pytest_drive_robust.verdict.forms import rule_of
from pytest_drive_robust.verdict.model import Requirement

LATENCY = ladder_of(InferenceLatency, dt_s=0.02)


@dataclass
class Scores:
    """A campaign whose agent loses 0.2 % of its score a millisecond, give or take; RD 0.30 is at 150 ms."""

    noise: float = 15.0

    def __post_init__(self) -> None:
        self.rulings: list[VerdictRule] = []
        self.levels: list[float] = []

    def decide(self, requirement: Requirement, scope: Scope, verdict_rule: VerdictRule) -> SimpleNamespace:
        self.rulings.append(verdict_rule)
        ms = float(requirement.setting.perturbations[0].parameters()["ms"])  # type: ignore[arg-type]
        self.levels.append(ms)
        draws = np.random.Generator(np.random.Philox(key=int(ms)))
        judge = judge_by(
            verdict_rule.kind, rule_of(requirement, verdict_rule), planned=len(scope.routes), alpha=verdict_rule.alpha
        )  # type: ignore[arg-type]
        scores = []
        for _ in scope.routes:
            scores.append(float(np.clip(80.0 * (1.0 - ms / 500.0) + draws.normal(0.0, self.noise), 0.0, 100.0)))
            if judge.read(scores[-1], 80.0) is not None:
                break
        value = 1.0 - sum(scores) / (80.0 * len(scores))
        verdict = SimpleNamespace(requirement=requirement, decision=judge.close(), value=value, routes=len(scores))
        return SimpleNamespace(verdict=verdict)


def scope(routes: int) -> Scope:
    return Scope("driver", "made up", tuple(fake_route(str(number)) for number in range(routes)), (0,))


def test_with_enough_routes_the_bracket_rests_on_evidence_and_stops_early_far_from_the_crossing() -> None:
    campaign = Scores()
    found = largest(LATENCY, campaign, scope=scope(220), metric="RD", limit=0.30)  # type: ignore[arg-type]
    assert found.rule == "evidence"
    assert {(verdict_rule.kind, verdict_rule.alpha) for verdict_rule in campaign.rulings} == {("evidence", ALPHA)}
    assert all(verdict_rule.margin < 1e-6 for verdict_rule in campaign.rulings)
    assert found.holds in (120.0, 140.0)
    assert found.breaks in (160.0, 180.0)
    assert all(probe.routes < 80 for probe in found.probes if abs(probe.value - 0.30) > 0.15)
    assert max(probe.routes for probe in found.probes) == 220


def test_with_few_routes_values_are_compared() -> None:
    campaign = Scores(noise=0.0)
    found = largest(LATENCY, campaign, scope=scope(8), metric="RD", limit=0.30)  # type: ignore[arg-type]
    assert (found.rule, found.holds, found.breaks) == ("point", 140.0, 160.0)
    assert {verdict_rule.kind for verdict_rule in campaign.rulings} == {"point"}
    assert len(campaign.levels) <= 6


def test_the_comparison_follows_the_metric() -> None:
    found = largest(LATENCY, Scores(noise=0.0), scope=scope(8), metric="RD", limit=0.30, comparison=">=")  # type: ignore[arg-type]
    assert found.comparison == ">="
    assert largest(LATENCY, Scores(), scope=scope(8), metric="RD", limit=0.30).comparison == "<="  # type: ignore[arg-type]


def test_a_limit_that_no_agent_can_miss_is_refused_before_anything_is_driven() -> None:
    campaign = Scores()
    with pytest.raises(RequirementError, match="holds for every agent"):
        largest(LATENCY, campaign, scope=scope(8), metric="RD", limit=1.0)  # type: ignore[arg-type]
    assert campaign.levels == []
