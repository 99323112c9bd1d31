"""What each loss of the compact UniAD asks for."""

from __future__ import annotations

import math

import pytest

torch = pytest.importorskip("torch")


from drive_robust_agents.training.recipes.uniad_losses import (  # noqa: E402
    collision_loss,
    heat_loss,
    mask_loss,
    motion_loss,
    painted,
)

NAN = float("nan")


def box(x: float, y: float, yaw: float, length: float, width: float, kind: int = 0) -> torch.Tensor:
    return torch.tensor([[[x, y, math.sin(yaw), math.cos(yaw), length, width, 3.0, kind, 1.0]]])


def straight(right_m: float = 0.0) -> torch.Tensor:
    return torch.stack((torch.arange(1.0, 7.0) * 3.0, torch.full((6,), right_m)), dim=-1)[None]


def expert(right_m: float = 0.0) -> torch.Tensor:
    return torch.cat((straight(right_m), torch.zeros(1, 6, 1)), dim=-1)


def test_a_plan_into_a_body_is_pushed_out_of_it() -> None:
    body, futures = box(9.0, 0.8, 0.0, 4.0, 2.0), torch.tensor([9.0, 0.8]).expand(1, 1, 6, 2)
    plan = straight().requires_grad_()
    collision_loss(plan, expert(-4.0), body, futures).backward()
    assert plan.grad is not None
    assert plan.grad[0, 2, 1] > 0.0
    assert plan.grad[0, 5].abs().sum() == 0.0


def test_a_plan_beside_a_body_and_one_that_the_expert_drove_cost_nothing() -> None:
    body, futures = box(9.0, 0.8, 0.0, 4.0, 2.0), torch.tensor([9.0, 0.8]).expand(1, 1, 6, 2)
    assert collision_loss(straight(-4.0), expert(-4.0), body, futures) == 0.0
    assert collision_loss(straight(), expert(), body, futures) == 0.0
    assert collision_loss(straight(), expert(-4.0), body, torch.full_like(futures, NAN)) == 0.0
    closer = [collision_loss(straight(y), expert(-4.0), body, futures) for y in (-2.0, -1.5, -0.5)]
    assert 0.0 < closer[0] < closer[1] < closer[2]


def test_only_the_nearest_mode_learns_a_way_and_what_is_not_known_is_left_out() -> None:
    way = straight()
    way[:, 4:] = NAN
    paths = torch.stack((straight(5.0), straight(0.3), straight(-4.0)), dim=1).requires_grad_()
    spread, logits = torch.zeros(1, 3, 6, 3), torch.zeros(1, 3, requires_grad=True)
    motion_loss(paths, spread, logits, way).backward()
    assert paths.grad is not None
    assert logits.grad is not None
    assert (paths.grad.abs().sum((-1, -2)) > 0.0).tolist() == [[False, True, False]]
    assert paths.grad[0, 1, 4:].abs().sum() == 0.0
    assert logits.grad[0].argmin() == 1


def test_a_wider_spread_costs_less_where_the_way_was_missed_and_more_where_it_was_met() -> None:
    tight, wide = torch.zeros(1, 1, 6, 3), torch.zeros(1, 1, 6, 3)
    wide[..., :2] = 1.0

    def loss(right_m: float, spread: torch.Tensor) -> float:
        return float(motion_loss(straight(right_m)[:, None], spread, torch.zeros(1, 1), straight()))

    assert loss(4.0, wide) < loss(4.0, tight)
    assert loss(0.0, wide) > loss(0.0, tight)


def test_lanes_that_are_painted_right_cost_least_whatever_query_paints_them() -> None:
    truth = torch.zeros(1, 2, 20)
    truth[0, 0, :5], truth[0, 1, 12:15] = 1.0, 1.0
    kind = torch.tensor([[2, 0]])
    logits = torch.full((1, 3, 6), -4.0)
    logits[0, 2, 2], logits[0, 0, 0] = 4.0, 4.0
    masks = torch.full((1, 3, 20), -6.0)
    masks[0, 2, :5], masks[0, 0, 12:15] = 6.0, 6.0
    right = mask_loss(logits, masks, truth, kind)
    wrong = mask_loss(logits, masks.flip(2), truth, kind)
    assert right[1] < 0.2 < wrong[1]
    assert right[0] < mask_loss(logits.flip(2), masks, truth, kind)[0]


def test_without_lanes_and_agents_the_losses_are_numbers() -> None:
    found = mask_loss(torch.zeros(1, 2, 6), torch.zeros(1, 2, 9), torch.zeros(1, 3, 9), torch.full((1, 3), -1))
    none = motion_loss(torch.zeros(1, 3, 6, 2), torch.zeros(1, 3, 6, 3), torch.zeros(1, 3), torch.full((1, 6, 2), NAN))
    nothing = torch.zeros(1, 9)
    values = [*found, none, painted(nothing[:0], nothing[:0]), heat_loss(nothing, nothing)]
    assert all(math.isfinite(float(value)) for value in values)
    assert values[1] == values[2] == 0.0
