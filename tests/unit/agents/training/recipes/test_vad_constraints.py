"""VAD's constraints are 0 for a plan that keeps them and grow with how much it breaks them."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from drive_robust_agents.training.recipes.vad_constraints import (  # noqa: E402
    boundary_loss,
    collision_loss,
    direction_loss,
)

NAN = float("nan")


def straight(right_m: float = 0.0, speed_mps: float = 6.0, slope: float = 0.0) -> torch.Tensor:
    """(1, 6, 2): six waypoints 0.5 s apart."""
    ahead = speed_mps * 0.5 * torch.arange(1.0, 7.0)
    return torch.stack([ahead, right_m + slope * ahead], dim=-1)[None]


def car(x_m: float, y_m: float, *, valid: float = 1.0) -> tuple[torch.Tensor, torch.Tensor]:
    """A standing car among two boxes, and where both are in the next 3 s; the second is none."""
    boxes = torch.zeros(1, 2, 9)
    boxes[0, 0] = torch.tensor([x_m, y_m, 0.0, 1.0, 4.6, 1.9, 0.0, 0.0, valid])
    futures = torch.full((1, 2, 6, 2), NAN)
    futures[0, 0] = torch.tensor([x_m, y_m])
    return boxes, futures


def lines(*rights_m: float) -> torch.Tensor:
    """Straight lines (1, 3, 6, 2) to the right by so many metres, NaN for none."""
    lanes = torch.full((1, 3, 6, 2), NAN)
    for number, right_m in enumerate(rights_m):
        lanes[0, number, :, 0] = torch.linspace(-16.0, 64.0, 6)
        lanes[0, number, :, 1] = right_m
    return lanes


KINDS = torch.tensor([[0, 3, -1]])


def test_a_plan_that_stays_behind_a_car_does_not_collide() -> None:
    assert collision_loss(straight(), *car(40.0, 0.0)).item() == 0.0


def test_a_plan_that_passes_a_car_aside_does_not_collide() -> None:
    assert collision_loss(straight(), *car(9.0, 3.5)).item() == 0.0


def test_the_nearer_a_plan_comes_to_a_car_the_more_it_costs() -> None:
    costs = [collision_loss(straight(), *car(9.0, right_m)).item() for right_m in (1.6, 1.0, 0.5, 0.0)]
    assert costs[0] == 0.0
    assert costs[1] < costs[2] < costs[3]


def test_a_collision_pushes_the_plan_away() -> None:
    plan = straight().requires_grad_()
    collision_loss(plan, *car(9.5, 0.6)).sum().backward()
    assert plan.grad is not None
    assert plan.grad[0, 2, 1] > 0.0  # downhill is to the left, away from the car on the right
    assert plan.grad[0, 0].abs().sum() == 0.0


def test_a_car_that_has_gone_or_never_was_costs_nothing() -> None:
    boxes, futures = car(9.0, 0.0)
    futures[0, 0, 2:] = NAN
    assert collision_loss(straight(), boxes, futures).item() == 0.0
    assert collision_loss(straight(), *car(9.0, 0.0, valid=0.0)).item() == 0.0


def test_a_car_that_is_elsewhere_by_then_costs_nothing() -> None:
    boxes, futures = car(9.0, 0.0)
    futures[0, 0, :, 0] += 30.0
    assert collision_loss(straight(), boxes, futures).item() == 0.0


def test_within_the_road_the_edge_costs_nothing() -> None:
    assert boundary_loss(straight(), lines(0.0, 1.75), KINDS).item() == 0.0


def test_the_nearer_the_edge_the_more_it_costs() -> None:
    near, nearer = (boundary_loss(straight(right_m), lines(0.0, 1.75), KINDS).item() for right_m in (1.0, 1.5))
    assert near == pytest.approx(0.25, abs=1e-3)
    assert nearer == pytest.approx(0.75, abs=1e-3)


def test_only_solid_edges_are_edges() -> None:
    assert boundary_loss(straight(1.75), lines(0.0, 1.75), torch.tensor([[0, 2, -1]])).item() == 0.0


def test_without_lines_nothing_is_constrained() -> None:
    nothing = torch.full((1, 3), -1)
    assert boundary_loss(straight(), lines(), nothing).item() == 0.0
    assert direction_loss(straight(slope=0.3), lines(), nothing).item() == 0.0


def test_along_the_lane_the_direction_costs_nothing() -> None:
    assert direction_loss(straight(), lines(0.0, 1.75), KINDS).item() == pytest.approx(0.0, abs=1e-6)


def test_the_more_it_turns_off_the_lane_the_more_the_direction_costs() -> None:
    costs = [direction_loss(straight(slope=slope), lines(0.0), KINDS).item() for slope in (0.02, 0.05, 0.1)]
    assert 0.0 < costs[0] < costs[1] < costs[2]
    assert costs[1] == pytest.approx(0.05, rel=0.02)


def test_a_standing_plan_has_no_direction() -> None:
    plan = straight(speed_mps=0.2, slope=1.0).requires_grad_()
    cost = direction_loss(plan, lines(0.0), KINDS)
    assert cost.item() == 0.0
    cost.sum().backward()
    assert plan.grad is not None
    assert bool(plan.grad.isfinite().all())
