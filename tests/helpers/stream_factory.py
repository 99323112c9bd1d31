"""Observations and episodes for the tests of perturbations. Pixels are read-only: nobody may write into them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pytest_drive_robust.domain.observation import CameraSpec, Compass, Gps, Image, Imu, Observation, Speed
from pytest_drive_robust.perturbations import Perturbation, RunningStack, Setting

if TYPE_CHECKING:
    from pytest_drive_robust.domain.observation import Pixels

DT_S = 0.05


def flat_pixels(value: int, *, rows: int = 6, columns: int = 8) -> Pixels:
    """Return (rows, columns, 3) uint8, all of one value, read-only."""
    pixels = np.full((rows, columns, 3), value % 256, dtype=np.uint8)
    pixels.setflags(write=False)
    return pixels


def observation_at(tick: int, *, cameras: Sequence[str] = ("front",), pixels: Pixels | None = None) -> Observation:
    """Return what the sensors say in `tick`: every signal tells the tick by its value as well."""
    shown = flat_pixels(tick) if pixels is None else pixels
    return Observation(
        tick=tick,
        gps=Gps(float(tick), 2.0 * tick, tick),
        compass=Compass(0.01 * tick, tick),
        imu=Imu(0.1 * tick, 0.0, 0.0, tick),
        speed=Speed(10.0, tick),
        cameras={name: Image(shown, tick) for name in cameras},
    )


def started(
    setting: Setting | Perturbation,
    *,
    route_id: str = "2091",
    seed: int = 0,
    dt_s: float = DT_S,
    cameras: Sequence[str] = ("front", "rear"),
) -> RunningStack:
    """Return the stack at the start of an episode of an agent with these cameras."""
    stack = setting if isinstance(setting, Setting) else Setting.of(setting)
    rig = [CameraSpec(name) for name in cameras]
    return RunningStack.of(stack, route_id=route_id, seed=seed, dt_s=dt_s, cameras=rig)


def observed(
    setting: Setting | Perturbation, ticks: Iterable[int], *, seed: int = 0, cameras: Sequence[str] = ("front",)
) -> list[Observation]:
    """Return what the agent gets in `ticks`."""
    stack = started(setting, seed=seed, cameras=cameras)
    return [stack.observe(observation_at(tick, cameras=cameras)) for tick in ticks]
