"""The training of `tcp`: waypoints, the expert's controls now and later, the ego's speed, the freedom of the way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from drive_robust_agents._nets.tcp import TcpNet, TcpSpec
from drive_robust_agents.tcp import CAMERAS, joined
from drive_robust_agents.training.recipes.augment import occlude, tcp_hard
from drive_robust_agents.training.recipes.failures import MOST_HIDDEN, gps_errors, late, misread
from drive_robust_agents.training.recipes.recipe import Defaults, TrainingStage

if TYPE_CHECKING:
    from drive_robust_agents.training.recipes.recipe import Arrays

__all__ = ["TcpRecipe", "beta_nll"]

Floats32 = NDArray[np.float32]

_PICTURES = tuple(f"cam_{camera.name}" for camera in CAMERAS)
_HALF_SECONDS = (1, 3, 5, 7)
"""Columns of `future` (a quarter of a second apart) that are the waypoints."""
_FREE_M, _FREE_S = 4.0, 1.5
_EDGE = 0.02
"""Distance of actions from 0 and 1, where Beta distributions have no useful density."""


class TcpRecipe:
    """TCP's losses: L1 of waypoints, 0.1 x NLL of actions (now and four later), 0.05 x speed, 0.001 x value.

    `robust` adds deployment failures of the inputs, with true labels: a black rectangle in every second picture of each
    camera; for a third of the rows each, GPS noise of 0 to 15 m on the target point and a measured speed that is too
    low; and waypoints that begin up to 0.5 s late, so that a delayed control still fits.
    """

    name = "tcp"
    needs = (*_PICTURES, "speed", "target", "command", "future", "future_ok", "controls", "gap")
    history = ()
    stages = (TrainingStage(),)
    defaults = Defaults(batch=64, lr=1e-3, weight_decay=0.01, clip=1.0, visits=1_500_000)

    def __init__(self, *, robust: bool = False) -> None:
        self.robust = robust

    def make(self, spec: Mapping[str, Any] | None = None) -> nn.Module:
        """Return a new network."""
        return TcpNet(TcpSpec()) if spec is None else TcpNet.build(spec)

    def batch(self, arrays: Arrays, generator: np.random.Generator, training: bool) -> dict[str, Tensor]:
        """Return the inputs of `TcpNet.forward` by name, and targets named `true_...`."""
        image = joined([arrays[picture] for picture in _PICTURES])
        speed, target = arrays["speed"].astype(np.float32), arrays["target"][:, 0, 0].astype(np.float32)
        future, ok = arrays["future"].astype(np.float32), arrays["future_ok"]
        sensed = speed.copy()
        if training:
            tcp_hard(image, generator, strength=generator.random())
            if self.robust:
                for third in np.split(image, len(CAMERAS), axis=2):
                    occlude(third, generator, chance=0.5, most=MOST_HIDDEN)
                target = (target + gps_errors(len(target), generator)).astype(np.float32)
                sensed, future = misread(speed, generator), late(future, generator)
        numbers = {
            "image": image,
            "speed": sensed,
            "target": target,
            "command": arrays["command"][:, 0].astype(np.int64),
            "true_waypoints": future[:, _HALF_SECONDS, :2],
            "true_ok": ok[:, _HALF_SECONDS].astype(np.float32),
            "true_actions": _actions(arrays["controls"]),
            "true_speed": speed,
            "true_value": _freedom(arrays["gap"], speed),
        }
        return {name: torch.from_numpy(np.ascontiguousarray(value)) for name, value in numbers.items()}

    def loss(self, net: nn.Module, batch: Mapping[str, Tensor]) -> tuple[Tensor, Mapping[str, Tensor | float]]:
        """Return the weighted sum, and metres and nats to show."""
        inputs = {name: batch[name] for name in ("image", "speed", "target", "command")}
        out: dict[str, Tensor] = net(**inputs, full=True)
        off = (out["waypoints"].float() - batch["true_waypoints"]).abs().sum(2) * 0.5
        waypoints = (off * batch["true_ok"]).sum() / batch["true_ok"].sum().clamp_min(1.0)
        alpha, beta = out["beta"].float().unbind(-1)
        actions = beta_nll(alpha, beta, batch["true_actions"]).mean()
        speed = (out["speed"].float() - batch["true_speed"]).abs().mean()
        value = (out["values"].float() - batch["true_value"][:, None]).square().mean()
        parts = {"waypoints": waypoints, "actions": actions, "speed": speed, "value": value}
        total = waypoints + 0.1 * actions + 0.05 * speed + 0.001 * value
        return total, {name: part.detach() for name, part in parts.items()}


def beta_nll(alpha: Tensor, beta: Tensor, value: Tensor) -> Tensor:
    """Return minus the logarithm of the Beta density of values between 0 and 1, element by element."""
    constant = torch.lgamma(alpha) + torch.lgamma(beta) - torch.lgamma(alpha + beta)
    return constant - (alpha - 1.0) * value.log() - (beta - 1.0) * (1.0 - value).log()


def _actions(controls: NDArray[Any]) -> Floats32:
    """Return (N, 5, 3) throttle, steering, brake -> (N, 5, 2) steering and acceleration, 0 to 1, away from the ends."""
    controls = controls.astype(np.float32)
    signed = np.stack([controls[..., 1], controls[..., 0] - controls[..., 2]], axis=-1)
    actions: Floats32 = np.clip(0.5 * (signed + 1.0), _EDGE, 1.0 - _EDGE)
    return actions


def _freedom(gap: NDArray[Any], speed: Floats32) -> Floats32:
    """Return (N,) 0 to 1: how much of the way that this speed wants is free, for the expert's value function."""
    distance, other = gap[:, 0].astype(np.float32), gap[:, 1].astype(np.float32)
    wanted = _FREE_M + _FREE_S * speed + np.maximum(speed - other, 0.0) ** 2 / 8.0
    free: Floats32 = 1.0 - np.exp(-np.maximum(distance, 0.0) / wanted)
    return free
