"""Labels from above: what lies in each cell."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")


from drive_robust_agents._nets.bev_net import DENSE_CHANNELS  # noqa: E402
from drive_robust_agents.training.recipes.dense import dense_targets  # noqa: E402
from pytest_drive_robust.domain.truth import ActorKind  # noqa: E402


def test_a_cell_is_labelled_by_the_body_that_covers_it_and_the_lines_through_it() -> None:
    boxes = torch.zeros(1, 2, 9)
    boxes[0, 0] = torch.tensor([20.0, 5.0, 1.0, 0.0, 8.0, 2.0, 0.0, ActorKind.TRUCK, 1.0])
    boxes[0, 1] = torch.tensor([4.0, -6.0, 0.0, 1.0, 0.6, 0.6, 0.0, ActorKind.PEDESTRIAN, 1.0])
    lanes = torch.full((1, 2, 2, 2), float("nan"))
    lanes[0, 0] = torch.tensor([[0.0, 0.0], [40.0, 0.0]])
    cells = torch.tensor([[20.0, 5.0], [20.0, 8.5], [23.0, 5.0], [4.0, -6.0], [30.0, 0.9], [30.0, 4.0], [45.0, 0.0]])
    found = dense_targets(boxes, lanes, torch.tensor([[0, -1]]), cells, torch.full_like(cells, 2.0))[0]
    assert found[DENSE_CHANNELS.index("vehicle")].tolist() == [1, 1, 0, 0, 0, 0, 0]
    assert found[DENSE_CHANNELS.index("other")].tolist() == [0, 0, 0, 1, 0, 0, 0]
    assert found[DENSE_CHANNELS.index("route")].tolist() == [0, 0, 0, 0, 1, 0, 0]
    assert found.sum() == 4
