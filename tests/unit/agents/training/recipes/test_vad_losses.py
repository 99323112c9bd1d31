"""The losses of VAD's sets of queries."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")


from drive_robust_agents.training.recipes.matching import match  # noqa: E402
from drive_robust_agents.training.recipes.vad_losses import lane_loss, path_loss  # noqa: E402


def test_a_line_may_be_told_from_either_end() -> None:
    target = torch.full((1, 2, 3, 2), float("nan"))
    target[0, 0] = torch.tensor([[0.0, 1.0], [5.0, 1.0], [10.0, 2.0]])
    kind = torch.tensor([[2, -1]])
    logits = [torch.zeros(1, 1, 6)]
    forward = lane_loss(logits, [target[:, :1]], target, kind)
    backward = lane_loss(logits, [target[:, :1].flip(2)], target, kind)
    off = lane_loss(logits, [target[:, :1] + 1.0], target, kind)
    assert forward[1].item() == backward[1].item() == pytest.approx(0.0, abs=1e-6)
    assert off[1].item() > 0.1


def test_only_the_best_mode_learns_a_path() -> None:
    boxes = torch.zeros(1, 1, 9)
    futures = torch.zeros(1, 1, 6, 2)
    futures[0, 0, :, 0] = torch.arange(1.0, 7.0)
    futures[0, 0, 4:] = float("nan")
    paths = torch.zeros(1, 1, 3, 6, 2)
    paths[0, 0, 1, :, 0] = torch.arange(1.0, 7.0) + 0.1
    paths.requires_grad_()
    logits = torch.zeros(1, 1, 3, requires_grad=True)
    found = match(torch.zeros(1, 1, 1), torch.ones(1, 1, dtype=torch.bool))
    path_loss(paths, logits, boxes, futures, found).backward()
    assert paths.grad is not None
    assert logits.grad is not None
    assert (paths.grad.abs().sum((-1, -2)) > 0.0).tolist() == [[[False, True, False]]]
    assert paths.grad[0, 0, 1, 4:].abs().sum() == 0.0
    assert logits.grad[0, 0].argmin() == 1
