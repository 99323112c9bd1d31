"""The learning rate over the stages of a training."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from drive_robust_agents.training.loop.schedule import cycle, learning_rate, stage_at
from drive_robust_agents.training.recipes.recipe import TrainingStage


def test_the_learning_rate_rises_then_falls_in_every_stage() -> None:
    stages = (TrainingStage(0.25), TrainingStage(0.75, ("encoder",)))
    rates = [learning_rate(stages, step, 400, 1e-3) for step in range(400)]
    assert max(rates[:100]) == pytest.approx(1e-3, rel=1e-3)
    assert max(rates[100:]) == pytest.approx(1e-3, rel=1e-3)
    assert rates[99] < 1e-5
    assert rates[399] < 1e-5
    assert [stage_at(stages, step, 400)[0] for step in (0, 99, 100, 399)] == [0, 0, 1, 1]
    assert cycle(0.0) == pytest.approx(0.04)
