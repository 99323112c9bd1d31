"""Each learned agent has a recipe."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from drive_robust_agents.training.data.rigs import agent_rig
from drive_robust_agents.training.recipes.recipe import RECIPES, Defaults, recipe_of
from pytest_drive_robust.errors import UnknownNameError


def test_every_learned_agent_has_a_recipe() -> None:
    for name in RECIPES:
        recipe = recipe_of(name)
        assert recipe.name == name
        assert isinstance(recipe.defaults, Defaults)
        assert sum(stage.share for stage in recipe.stages) > 0.0
        assert {f"cam_{camera.name}" for camera in agent_rig(name).cameras} <= set(recipe.needs)


def test_a_misspelt_agent_is_told_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'simlingo'"):
        recipe_of("simlinog")
