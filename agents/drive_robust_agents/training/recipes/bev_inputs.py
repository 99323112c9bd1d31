"""The training inputs of UniAD's and VAD's networks: pictures, can bus, and for some rows the frame 0.5 s earlier."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from drive_robust_agents._vehicle.mkz import TICK_S
from drive_robust_agents._wrappers.bev_agent import CAMERAS
from drive_robust_agents._wrappers.memory import LAG_TICKS, can_bus, motion_between
from drive_robust_agents.training.recipes.augment import photometric_gridmask
from drive_robust_agents.training.recipes.failures import gps_errors, hang, misread, muddy

__all__ = ["HISTORY", "NEEDS", "bev_inputs", "driven_in", "remembered"]

Recall = Callable[[Tensor, Tensor], Mapping[str, Tensor]]
"""A function of pictures and can bus that returns their memory."""

_IMAGES = tuple(f"cam_{camera.name}" for camera in CAMERAS)
NEEDS = (*_IMAGES, "speed", "imu", "pose", "command")
"""Arrays of a sample that this module reads."""
HISTORY = (*_IMAGES, "speed", "imu", "pose")
"""Arrays that this module reads of the frame 0.5 s earlier, too."""

_LAG_S = LAG_TICKS * TICK_S
_MEMORY_SHARE = 0.5
_TWO_FIXES = math.sqrt(2.0)
"""Error of the movement between two noisy positions, relative to the error of one position."""


def bev_inputs(
    arrays: Mapping[str, NDArray[Any]], generator: np.random.Generator, training: bool, *, robust: bool = False
) -> dict[str, Tensor]:
    """Return the inputs that `BevAgent` documents, without `old_bev`, and the inputs of `remembered`, which makes it.

    In training only half of the rows with an earlier frame get that frame: this saves time, and the other rows teach to
    drive without a memory. The movement in the can bus is integrated from speed and yaw rate over 0.5 s. It is not the
    difference of two poses, which would reveal the shift of a frame from a shifted pose.

    `robust` adds deployment failures in training. Every second row gets a black rectangle in each camera, in the
    present picture and in the memory. A third of the rows each get some hanging cameras, which show the picture of the
    memory; GPS noise of 0 to 15 m in the ego's movement; and a speedometer that reads a fraction, now and in the
    memory.
    """
    images = np.stack([arrays[name] for name in _IMAGES], axis=1)
    old_images = np.stack([arrays[f"old_{name}"] for name in _IMAGES], axis=1)
    known: NDArray[np.bool_] = arrays["old_ok"]
    if training:
        known = known & (generator.random(len(images)) < _MEMORY_SHARE)
        photometric_gridmask(images, generator)
        seen = old_images[known]
        photometric_gridmask(seen, generator)
        old_images[known] = seen
    motion = motion_between(arrays["old_pose"], arrays["pose"]) * known[:, None]
    moved = driven_in(arrays["speed"], arrays["imu"]) * known[:, None]
    old_moved = driven_in(arrays["old_speed"], arrays["old_imu"])
    speed, old_speed = arrays["speed"], arrays["old_speed"]
    if training and robust:
        hang(images, old_images, known, generator)
        muddy(images, old_images, generator)
        jumps = _TWO_FIXES * gps_errors(len(images), generator).astype(np.float32) * known[:, None]
        motion[:, :2] += jumps
        moved[:, :2] += jumps
        speed, old_speed = misread(np.stack([speed, old_speed]), generator)
    values = {
        "images": images,
        "can_bus": can_bus(speed, arrays["imu"], moved),
        "command": arrays["command"][:, 0].astype(np.int64),
        "motion": motion,
        "known": known.astype(np.float32),
        "old_images": old_images,
        "old_can_bus": can_bus(old_speed, arrays["old_imu"], old_moved),
    }
    return {name: torch.from_numpy(value) for name, value in values.items()}


def driven_in(speed: NDArray[Any], imu: NDArray[Any]) -> NDArray[np.float32]:
    """Return (n, 3): the movement of the last 0.5 s, as `motion_between`, from speed (n,) and IMU (n, 3)."""
    turned = imu[:, 2] * _LAG_S
    way = np.maximum((speed - 0.5 * imu[:, 0] * _LAG_S) * _LAG_S, 0.0)
    return np.column_stack([way * np.cos(turned / 2.0), way * np.sin(turned / 2.0), turned]).astype(np.float32)


def remembered(
    net: nn.Module, recall: Recall, shapes: Mapping[str, tuple[int, ...]], batch: Mapping[str, Tensor]
) -> dict[str, Tensor]:
    """Return the memory that `recall` makes of the frame 0.5 s earlier: (N, *shape) by name, zeros for rows without.

    The memory is computed without gradient and with `net` in evaluation mode, as published; the modes are restored.
    """
    known = batch["known"]
    old = {name: known.new_zeros(len(known), *shape) for name, shape in shapes.items()}
    rows = known.nonzero()[:, 0]
    if len(rows):
        with torch.no_grad(), _as_driven(net):
            kept = recall(batch["old_images"][rows], batch["old_can_bus"][rows])
        old = {name: value.index_copy(0, rows, kept[name].to(value.dtype)) for name, value in old.items()}
    return old


@contextmanager
def _as_driven(net: nn.Module) -> Iterator[None]:
    learning = [module for module in net.modules() if module.training]
    net.eval()
    try:
        yield
    finally:
        for module in learning:
            module.training = True
