"""Bird's-eye map of features from cameras, with half a second of memory, for UniAD and VAD.

As in BEVFormer (Li et al. 2022), which both published agents use, a query for each cell attends to the image where the
cell is seen, knows the can bus, and is mixed with the previous map, moved by the sensed motion of the vehicle. Compact:
one layer instead of six; attention within the 3 x 3 image tokens around the projection instead of deformable sampling,
each head at its own height; a gate instead of temporal attention; a memory one step deep (the map of 0.5 s ago is
remembered without *its* memory), so that training on pairs of pictures sees the maps that driving sees.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from drive_robust_agents._nets.attention import attend
from drive_robust_agents._nets.bev_grid import BevSpec, TokensInSight, camera_views
from drive_robust_agents._nets.blocks import BasicBlock, ImageNorm, MiniResNet, Mlp
from pytest_drive_robust.arithmetic import scalars

__all__ = ["BevEncoder", "BevLift", "CameraEncoder", "TemporalFusion", "columns_of", "rows_of", "warp"]

_CAN_BUS_UNITS = (10.0, 1.0, 5.0, 5.0, 5.0, 1.0)
"""Divisors of the six numbers of the can bus: speed [m/s], yaw rate [rad/s], acceleration forward and to the right
[m/s2], and the sensed movement of the last 0.5 s, forward and to the right in the old ego frame [m]."""


class CameraEncoder(nn.Module):
    """Pictures of all cameras -> image tokens of `width`: (N, C, H, W, 3) uint8 -> (N, C, tokens, width).

    MiniResNet(48, 96; stem 32) gives maps of stride 8 and 16. The coarse map is added to the fine map, as in
    the published feature pyramid, because at stride 16 the ground from 10 m to the horizon is a single token high.
    """

    def __init__(self, spec: BevSpec) -> None:
        super().__init__()
        self.normalise = ImageNorm()
        self.net = MiniResNet((48, 96), stem=32)
        self.fine = nn.Conv2d(48, spec.width, 1)
        self.coarse = nn.Conv2d(96, spec.width, 1)
        tokens = (spec.image_height_px // spec.token_px) * (spec.image_width_px // spec.token_px)
        self.camera = nn.Parameter(torch.randn(len(spec.cameras), 1, spec.width) * 0.1)
        self.place = nn.Parameter(torch.randn(1, tokens, spec.width) * 0.1)

    def forward(self, images: Tensor) -> Tensor:
        """Encode every camera by one network, then add codes of the camera and of the token's place."""
        fine = self.net.blocks[0](self.net.stem(self.normalise(images)))
        coarse = self.coarse(self.net.blocks[1](fine))
        both = self.fine(fine) + functional.interpolate(coarse, scale_factor=2.0, mode="nearest")
        tokens: Tensor = both.permute(0, 2, 3, 1).reshape(*images.shape[:2], -1, both.shape[1])
        return tokens + self.camera + self.place


class BevLift(nn.Module):
    """Geometry-masked cross-attention: image tokens (N, C, tokens, d) and can bus (N, 6) -> map (N, d, rows, columns).

    Each head looks at another height of the cell's pillar; a cell that several cameras see takes the mean. The result
    is scaled by learned factors of the cell, because a token holds all depths of its ray and the cell picks its own.
    The tables depend only on the rig and are no part of the weights.
    """

    gather: Tensor
    share: Tensor
    scale: Tensor

    def __init__(self, spec: BevSpec) -> None:
        super().__init__()
        self.spec, self.heads = spec, len(spec.heights_m)
        views = camera_views(spec)
        self.query = nn.Parameter(torch.randn(spec.cells, spec.width) * 0.2)
        self.can_bus = Mlp(8, 64, spec.width)
        self.to_query = nn.Linear(spec.width, spec.width)
        self.to_key_value = nn.Linear(spec.width, 2 * spec.width)
        self.out = nn.Linear(spec.width, spec.width)
        self.pick = nn.Parameter(torch.ones(spec.cells, spec.width))
        self.feed_forward = Mlp(spec.width, 2 * spec.width, spec.width)
        self.norms = nn.ModuleList(nn.LayerNorm(spec.width) for _ in range(2))
        for number, view in enumerate(views):
            self.register_buffer(f"cells_{number}", torch.from_numpy(view.cells), persistent=False)
            self.register_buffer(f"bias_{number}", torch.from_numpy(view.bias), persistent=False)
        self.register_buffer("scale", 1.0 / torch.tensor(_CAN_BUS_UNITS), persistent=False)
        gather, share = _merging(views, spec.cells)
        self.register_buffer("gather", gather, persistent=False)
        self.register_buffer("share", share, persistent=False)

    def forward(self, tokens: Tensor, can_bus: Tensor) -> Tensor:
        """Lift tokens to the map; the can bus is added to every query, as published."""
        signals = functional.pad(can_bus.to(self.scale.dtype) * self.scale, (0, 2))
        query = self.query + self.can_bus(signals)[:, None]
        lifted = self.out(self.look(self.to_query(query), self.to_key_value(tokens)))
        x = self.norms[0](query + lifted * self.pick)
        x = self.norms[1](x + self.feed_forward(x))
        y: Tensor = x.reshape(x.shape[0], self.spec.rows, self.spec.columns, -1).permute(0, 3, 1, 2)
        return y

    def look(self, query: Tensor, key_value: Tensor) -> Tensor:
        """Attend from cells to cameras: queries (N, cells, d), keys and values (N, C, tokens, 2 d) -> (N, cells, d)."""
        by_camera = key_value.unbind(1)  # indexing would give each camera a whole map of zeros as gradient
        seen = [self._one_camera(number, query, mine) for number, mine in enumerate(by_camera)]
        nothing = query.new_zeros(query.shape[0], 1, query.shape[-1])
        pairs = torch.cat((*seen, nothing), dim=1)
        places = self.gather.shape[1]
        total = pairs.index_select(1, self.gather[:, 0])
        for place in range(1, places):
            total = total + pairs.index_select(1, self.gather[:, place])
        return total * self.share

    def _one_camera(self, number: int, query: Tensor, key_value: Tensor) -> Tensor:
        """Return the features of the cells that one camera sees: (N, cells of the camera, d)."""
        mine = query.index_select(1, self.get_buffer(f"cells_{number}"))
        parts = (mine, *key_value.chunk(2, dim=2))
        q, k, v = (x.reshape(*x.shape[:2], self.heads, -1).transpose(1, 2) for x in parts)
        bias = self.get_buffer(f"bias_{number}").to(q.dtype)[None]
        return attend(q, k, v, mask=bias).transpose(1, 2).flatten(2)


def _merging(views: tuple[TokensInSight, ...], cells: int) -> tuple[Tensor, Tensor]:
    """Return for each cell its rows in the concatenated outputs of all cameras (cells, most), and 1 / count (cells, 1).

    Cells that fewer cameras see are padded with the row after the last row, which is zero.
    """
    rows: list[list[int]] = [[] for _ in range(cells)]
    row = 0
    for view in views:
        for cell in view.cells:
            rows[int(cell)].append(row)
            row += 1
    most = max(map(len, rows))
    table = torch.tensor([[*mine, *[row] * (most - len(mine))] for mine in rows], dtype=torch.int64)
    count = torch.tensor([[1.0 / max(len(mine), 1)] for mine in rows])
    return table, count


def warp(memory: Tensor, motion: Tensor, centres: Tensor, spec: BevSpec) -> Tensor:
    """Return the old map in the present ego frame: (N, d, rows, columns) and motion (N, 3) -> (N, d, rows, columns).

    `motion` is the present pose in the old ego frame: x, y [m], yaw [rad, clockwise]; `centres` are those of `spec`.
    Places outside the old map are zero. (`affine_grid` works for equal columns only; our columns are bent.)
    """
    cos, sin = torch.cos(motion[:, 2, None, None]), torch.sin(motion[:, 2, None, None])
    x = motion[:, 0, None, None] + cos * centres[..., 0] - sin * centres[..., 1]
    y = motion[:, 1, None, None] + sin * centres[..., 0] + cos * centres[..., 1]
    grid = torch.stack((columns_of(y, spec), rows_of(x, spec)), dim=-1)
    return functional.grid_sample(memory, grid, mode="bilinear", padding_mode="zeros", align_corners=False)


def rows_of(x_m: Tensor, spec: BevSpec) -> Tensor:
    """Return the row coordinate -1..1 (edges of the grid) of metres ahead."""
    return (x_m + spec.behind_m) * (2.0 / (spec.behind_m + spec.ahead_m)) - 1.0


def columns_of(y_m: Tensor, spec: BevSpec) -> Tensor:
    """Return the column coordinate -1..1 (edges of the grid) of metres to the right."""
    off = y_m * (scalars.sinh(spec.bend) / spec.aside_m)
    return torch.sign(off) * torch.log(off.abs() + torch.sqrt(off * off + 1.0)) / spec.bend  # asinh, as ONNX knows it


class TemporalFusion(nn.Module):
    """Mixes the present map with the map of 0.5 s ago: a gated sum, then two 3x3 convolutions around a shortcut."""

    centres: Tensor

    def __init__(self, spec: BevSpec) -> None:
        super().__init__()
        self.spec = spec
        self.register_buffer("centres", torch.from_numpy(spec.centres()), persistent=False)
        self.gate = nn.Conv2d(2 * spec.width, spec.width, 1)
        self.value = nn.Conv2d(spec.width, spec.width, 1, bias=False)
        self.mix = BasicBlock(spec.width, spec.width)

    def forward(self, now: Tensor, memory: Tensor, motion: Tensor) -> Tensor:
        """Fuse maps (N, d, rows, columns), given the motion (N, 3) as in `warp`. A memory of zeros adds nothing."""
        before = warp(memory, motion, self.centres, self.spec)
        gate = torch.sigmoid(self.gate(torch.cat((now, before), dim=1)))
        y: Tensor = self.mix(now + gate * self.value(before))
        return y


class BevEncoder(nn.Module):
    """Encodes pictures, can bus (as measured) and memory to the map that heads read, and the map to remember.

    Shapes: images (N, C, H, W, 3) uint8, can bus (N, 6), memory (N, d, rows, columns), motion (N, 3); two maps
    (N, d, rows, columns) in channels-last memory.
    """

    def __init__(self, spec: BevSpec) -> None:
        super().__init__()
        self.spec = spec
        self.cameras = CameraEncoder(spec)
        self.lift = BevLift(spec)
        self.fusion = TemporalFusion(spec)

    def look(self, images: Tensor, can_bus: Tensor) -> Tensor:
        """Return the map of this moment alone, which is then remembered."""
        y: Tensor = self.lift(self.cameras(images), can_bus)
        return y

    def forward(self, images: Tensor, can_bus: Tensor, memory: Tensor, motion: Tensor) -> tuple[Tensor, Tensor]:
        """Return (map for the heads, map to remember)."""
        now = self.look(images, can_bus)
        return self.fusion(now, memory, motion), now
