"""The training of `uniad` in two stages as published: perception first, then everything with the plan.

Losses beyond the published ones, to learn from little data: dense labels and a heat map of centres from the first step
on (agent queries begin at its peaks), and hints to the ego's query about the light and near things ahead.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import torch
from torch import Tensor, nn

from drive_robust_agents._nets.bev_net import LANE_CLASSES
from drive_robust_agents._nets.uniad import Perceived, UniadNet, UniadSpec, move
from drive_robust_agents._nets.uniad_heads import PriorAgents
from drive_robust_agents.training.recipes.bev_inputs import HISTORY, NEEDS, bev_inputs, remembered
from drive_robust_agents.training.recipes.bev_losses import agent_loss, hint_loss
from drive_robust_agents.training.recipes.dense import dense_loss
from drive_robust_agents.training.recipes.matching import Match
from drive_robust_agents.training.recipes.recipe import Defaults, TrainingStage
from drive_robust_agents.training.recipes.uniad_losses import (
    collision_loss,
    heat_loss,
    mask_loss,
    motion_loss,
    occupancy_loss,
    pairs_table,
)
from drive_robust_agents.training.recipes.uniad_targets import (
    cells_of,
    draw,
    from_above,
    heat_of,
    in_boxes,
    occupied_by,
    on_lines,
    own_way,
)

if TYPE_CHECKING:
    from drive_robust_agents.training.recipes.recipe import Arrays

__all__ = ["UniadRecipe"]

_LABELS = ("boxes", "box_future", "lanes", "lane_kind", "future", "future_ok", "facts")
_HALF_SECONDS = (1, 3, 5, 7, 9, 11)
"""Columns of `future` (a quarter of a second apart) that are 0.5 s apart."""
_DRAWN_AGENTS = 6
"""Number of nearest agents with occupancy labels, because each costs a map of 5 x 80 x 32."""
_WEIGHTS = {"plan": 4.0, "collision": 4.0, "metres": 0.0}
"""Weights of the losses. Published: 1, 1, with which a small network on few samples learns mostly boxes and lines."""
_LATER = ("motion", "occupancy", "planner")


class UniadRecipe:
    """UniAD's losses: tracks, lanes, motion, occupancy, plan with collision losses (2.5, 1, 0.25 for 0, 0.5, 1 m).

    `robust` adds deployment failures of the inputs, see `bev_inputs`; the labels stay true.
    """

    name = "uniad"
    needs = (*NEEDS, *_LABELS)
    history = HISTORY
    stages = (TrainingStage(0.3, _LATER), TrainingStage(0.7))
    defaults = Defaults(batch=32, lr=6e-4, weight_decay=0.01, clip=5.0, visits=250_000)

    def __init__(self, *, robust: bool = False) -> None:
        self.robust = robust

    def make(self, spec: Mapping[str, Any] | None = None) -> nn.Module:
        """Return a new network."""
        return UniadNet(UniadSpec()) if spec is None else UniadNet.build(spec)

    def batch(self, arrays: Arrays, generator: np.random.Generator, training: bool) -> dict[str, Tensor]:
        """Return the inputs of `bev_inputs`, and the labels of the sample, named `true_...`."""
        labels = {f"true_{name}": torch.from_numpy(np.ascontiguousarray(arrays[name])) for name in _LABELS}
        return bev_inputs(arrays, generator, training, robust=self.robust) | labels

    def loss(self, net: nn.Module, batch: Mapping[str, Tensor]) -> tuple[Tensor, Mapping[str, Tensor | float]]:
        """Return the weighted sum and its parts; while the later heads are frozen, only perception counts."""
        uniad = cast("UniadNet", net)
        now, front = uniad.look(batch["images"], batch["can_bus"])
        spec = uniad.spec
        shapes = {"bev": now.shape[1:], "queries": (spec.agents, spec.bev.width), "spots": (spec.agents, 2)}
        memory = remembered(uniad, uniad.recall, shapes, batch)
        fused = uniad.encoder.fusion(now, memory["bev"], batch["motion"])
        spots = move(memory["spots"], batch["motion"])
        seen = uniad.perceive(fused, front, PriorAgents(memory["queries"], spots, batch["known"]))
        parts, found = _seen(uniad, seen, batch)
        if any(weight.requires_grad for weight in uniad.planner.parameters()) or not uniad.training:
            parts |= _planned(uniad, seen, found, batch)
        total = torch.stack([_WEIGHTS.get(name, 1.0) * part for name, part in parts.items()]).sum()
        return total, {name: part.detach() for name, part in parts.items()}


def _seen(net: UniadNet, seen: Perceived, batch: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], Match]:
    """Return the losses of perception, and which query stands for which box."""
    bev, boxes, kind = net.spec.bev, batch["true_boxes"], batch["true_lane_kind"]
    lines = draw(cells_of(on_lines(batch["true_lanes"]), bev), bev.cells)
    bodies = draw(cells_of(in_boxes(boxes, boxes[..., :2]), bev), bev.cells)
    classes, shapes, found = agent_loss(seen.tracks.logits, seen.tracks.boxes, boxes)
    lane_kind, lane_mask = mask_loss(seen.lane_logits[..., : len(LANE_CLASSES)], seen.lane_masks, lines, kind)
    parts = {
        "dense": 4.0 * dense_loss(seen.dense.transpose(1, 2), from_above(bodies, lines, boxes, kind)),
        "heat": 0.5 * heat_loss(seen.heat, heat_of(boxes, bev)),
        "classes": classes,
        "boxes": shapes,
        "lanes": lane_kind,
        "masks": lane_mask,
        "hints": 0.5 * hint_loss(seen.tracks.hints, batch["true_facts"]),
    }
    return parts, found


def _planned(net: UniadNet, seen: Perceived, found: Match, batch: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the losses of motion, occupancy and plan; `metres` is the mean error of the plan, to show."""
    boxes, futures = batch["true_boxes"], batch["true_box_future"]
    pose, ok = batch["true_future"][:, _HALF_SECONDS].float(), batch["true_future_ok"][:, _HALF_SECONDS]
    motions = net.foresee(seen)
    way = torch.where(ok[..., None], pose[..., :2], torch.full_like(pose[..., :2], torch.nan))
    others = own_way(boxes, futures)[found.rows, found.targets]
    paths, spread, logits = motions.paths, motions.spread, motions.logits
    ego = motion_loss(paths[:, 0], spread[:, 0], logits[:, 0], way)
    matched = (found.rows, found.queries + 1)
    agents = motion_loss(paths[matched], spread[matched], logits[matched], others)
    plan = net.plan(seen, motions, batch["command"])
    off = (plan - pose[..., :2]).square().sum(-1).add(1e-6).sqrt() * ok
    metres = off.sum() / ok.sum().clamp(min=1)
    return {
        "ego": ego,
        "paths": agents if len(others) else agents * 0.0,
        "occupancy": _occupancy(net, seen, motions.modes, found, batch),
        "plan": metres,
        "collision": collision_loss(plan, pose[..., :3], boxes, futures),
        "metres": metres,
    }


def _occupancy(net: UniadNet, seen: Perceived, modes: Tensor, found: Match, batch: Mapping[str, Tensor]) -> Tensor:
    bev, steps = net.spec.bev, net.spec.occupancy_steps
    boxes, futures = batch["true_boxes"][:, :_DRAWN_AGENTS], batch["true_box_future"][:, :_DRAWN_AGENTS]
    truth = occupied_by(boxes, futures[:, :, : steps - 1], bev)
    queries, known = pairs_table(found, len(boxes), boxes.shape[1])
    rows = torch.arange(len(boxes), device=boxes.device)[:, None]
    maps = net.occupancy(seen.cells, bev.rows)
    whose = net.occupancy.of_agents(maps, seen.tracks.queries[1][rows, queries], modes[:, 1:][rows, queries])
    return occupancy_loss(whose.flatten(3), net.occupancy.anyone(maps).flatten(2), truth, known)
