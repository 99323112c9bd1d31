"""The training of the compact VAD: sets of agents and map vectors by matching, a plan under constraints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from drive_robust_agents._nets.vad import VadNet, VadSpec, choose
from drive_robust_agents.training.recipes.bev_inputs import HISTORY, NEEDS, bev_inputs, remembered
from drive_robust_agents.training.recipes.bev_losses import agent_loss, hint_loss
from drive_robust_agents.training.recipes.dense import dense_loss, dense_targets
from drive_robust_agents.training.recipes.recipe import Defaults, TrainingStage
from drive_robust_agents.training.recipes.vad_constraints import boundary_loss, collision_loss, direction_loss
from drive_robust_agents.training.recipes.vad_losses import lane_loss, path_loss

__all__ = ["VadRecipe", "plan_loss"]

_EVERY = 2
"""Step between waypoints in the expert's future, whose columns are 0.25 s apart."""

_WEIGHTS = {"collision": 1.0, "boundary": 1.0, "direction": 0.5}
"""The published weights of the constraints, relative to the plan's L1."""

_PLAN = 4.0
"""Weight of the plan and its constraints relative to perception. Published: 1, with which a small network on few
samples learns mostly boxes and lines."""

_HINTS = 0.5


class VadRecipe:
    """Trains all heads at once, with dense labels of the grid's cells as an auxiliary target.

    Published (VAD-base): two stages, perception first. On few samples the plan's own gradient is needed from the start,
    and so are hints to the ego query: what the light ahead shows, how near a stop line, a leader, an obstacle are.
    `robust` adds deployment failures of the inputs, see `bev_inputs`; the labels stay true.
    """

    name = "vad"
    needs: tuple[str, ...] = (*NEEDS, "facts", "future", "future_ok", "boxes", "box_future", "lanes", "lane_kind")
    history: tuple[str, ...] = HISTORY
    stages: tuple[TrainingStage, ...] = (TrainingStage(),)
    defaults = Defaults(batch=32, lr=4e-4, weight_decay=0.01, clip=35.0, visits=260_000)

    def __init__(self, *, robust: bool = False) -> None:
        self.robust = robust

    def make(self, spec: Mapping[str, Any] | None = None) -> nn.Module:
        """Return a new network."""
        return VadNet(VadSpec()) if spec is None else VadNet.build(spec)

    def batch(
        self, arrays: Mapping[str, NDArray[Any]], generator: np.random.Generator, training: bool
    ) -> dict[str, Tensor]:
        """Return the inputs of `bev_inputs`, `plan` (N, 6, 2), `plan_ok` (N, 6), boxes, lanes and facts."""
        inputs = bev_inputs(arrays, generator, training, robust=self.robust)
        future = arrays["future"][:, _EVERY - 1 :: _EVERY, :2]
        targets = {
            "plan": future.astype(np.float32),
            "plan_ok": arrays["future_ok"][:, _EVERY - 1 :: _EVERY].astype(np.float32),
            "boxes": arrays["boxes"].astype(np.float32),
            "box_future": arrays["box_future"].astype(np.float32),
            "lanes": arrays["lanes"].astype(np.float32),
            "lane_kind": arrays["lane_kind"].astype(np.int64),
            "facts": arrays["facts"].astype(np.float32),
        }
        return inputs | {name: torch.from_numpy(np.ascontiguousarray(value)) for name, value in targets.items()}

    def loss(self, net: nn.Module, batch: Mapping[str, Tensor]) -> tuple[Tensor, Mapping[str, Tensor | float]]:
        """Return the sum of all parts."""
        assert isinstance(net, VadNet)
        encoder, shape = net.encoder, (net.encoder.spec.width, net.encoder.spec.rows, net.encoder.spec.columns)
        memory = remembered(encoder, lambda *frame: {"bev": encoder.look(*frame)}, {"bev": shape}, batch)
        fused, _ = encoder(batch["images"], batch["can_bus"], memory["bev"], batch["motion"])
        told = net.heads(fused)
        boxes, lanes, kind = batch["boxes"], batch["lanes"], batch["lane_kind"]
        driving = plan_loss(choose(told["plans"], batch["command"]), batch)
        parts: dict[str, Tensor] = {}
        parts["agents"], parts["boxes"], found = agent_loss(told["agent_logits"], told["boxes"], boxes)
        parts["paths"] = path_loss(told["paths"], told["path_logits"], boxes, batch["box_future"], found)
        parts["lanes"], parts["points"] = lane_loss(told["line_logits"], told["lines"], lanes, kind)
        above = dense_targets(boxes, lanes, kind, net.centres, net.sizes)
        parts["dense"] = dense_loss(net.dense(told["tokens"]).transpose(1, 2), above)
        parts["hints"] = _HINTS * hint_loss(told["hints"], batch["facts"])
        total = _PLAN * torch.stack(list(driving.values())).sum() + torch.stack(list(parts.values())).sum()
        return total, {name: part.detach() for name, part in {**driving, **parts}.items()}


def plan_loss(plan: Tensor, batch: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the L1 of waypoints and steps [m], and the three constraints; unknown futures do not count."""
    known = batch["plan_ok"][..., None]
    off = plan - batch["plan"]
    count = (2.0 * known.sum()).clamp(min=1.0)
    step = torch.diff(off, dim=1, prepend=torch.zeros_like(off[:, :1]))
    lanes, kind = batch["lanes"], batch["lane_kind"]
    return {
        "plan": (off.abs() * known).sum() / count,
        "steps": (step.abs() * known).sum() / count,
        "collision": _WEIGHTS["collision"] * collision_loss(plan, batch["boxes"], batch["box_future"]).mean(),
        "boundary": _WEIGHTS["boundary"] * boundary_loss(plan, lanes, kind).mean(),
        "direction": _WEIGHTS["direction"] * direction_loss(plan, lanes, kind).mean(),
    }
