"""The losses that UniAD and VAD share."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")


from drive_robust_agents.training.recipes.bev_losses import class_of, hint_loss  # noqa: E402
from pytest_drive_robust.domain.truth import ActorKind  # noqa: E402


def test_every_kind_of_actor_has_a_class() -> None:
    kinds = torch.tensor([float(kind) for kind in ActorKind])
    classes = dict(zip(ActorKind, class_of(kinds).tolist(), strict=True))
    assert {kind.name for kind, number in classes.items() if number == 0} == {"CAR", "VAN", "TRUCK", "EMERGENCY"}
    assert classes[ActorKind.BICYCLE] == 1
    assert classes[ActorKind.PEDESTRIAN] == 2
    assert {number for kind, number in classes.items() if kind > ActorKind.PEDESTRIAN} == {3}


def test_a_hint_asks_for_the_light_only_where_it_is_near() -> None:
    facts = torch.full((2, 16), 100.0)
    facts[:, 0], facts[0, 1] = 2.0, 20.0
    hints = torch.zeros(2, 8, requires_grad=True)
    hint_loss(hints, facts).backward()
    assert hints.grad is not None
    assert hints.grad[:, :5].argmin(1).tolist() == [3, 0]
