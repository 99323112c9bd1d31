"""Queries and labels are matched at least cost."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")


from drive_robust_agents.training.recipes.matching import match  # noqa: E402


def test_the_match_is_the_cheapest_and_leaves_out_what_is_not_there() -> None:
    cost = torch.tensor([[[1.0, 0.0, 9.0], [0.9, 8.0, 9.0], [5.0, 5.0, 0.0]], [[3.0, 2.0, 1.0]] * 3])
    found = match(cost, torch.tensor([[True, True, False], [False, False, False]]))
    assert [tuple(pair) for pair in torch.stack(list(found), dim=1).tolist()] == [(0, 0, 1), (0, 1, 0)]


def test_a_cost_that_is_no_number_is_matched_last() -> None:
    found = match(torch.tensor([[[float("nan")], [3.0]]]), torch.ones(1, 1, dtype=torch.bool))
    assert found.queries.tolist() == [1]
