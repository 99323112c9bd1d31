"""What the sensors of an official agent say, as an observation of the package and back.

Payloads are known by their form: uint8 (height, width, 4) is a camera, three numbers are a GNSS fix, seven an IMU, a
mapping with `speed` the speedometer, of which the leaderboard allows one each; lidar, radar and maps stay as they are.
So does the debug camera `bev`, which agents save and do not look at.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from pytest_drive_robust.arithmetic.scalars import cos
from pytest_drive_robust.domain.geodesy import to_geodetic, to_metric
from pytest_drive_robust.domain.observation import CameraSpec, Compass, Gps, Image, Imu, Observation, Speed

__all__ = ["SensedTick", "cameras_of", "kind_of"]

DEBUG_CAMERAS = ("bev",)
_SIGNALS = {"gps": ("gps",), "imu": ("imu", "compass"), "speed": ("speed",)}
"""Which signals of ours a payload of a kind holds."""


def cameras_of(sensors: Iterable[Mapping[str, Any]]) -> list[CameraSpec]:
    """Return the rig: the draws for a camera are asked by its place among the cameras of the agent, not by its id."""
    return [CameraSpec(str(item["id"])) for item in sensors if str(item["type"]).startswith("sensor.camera.")]


def kind_of(payload: Any) -> str:
    """Return `camera`, `gps`, `imu`, `speed`, or nothing for what is never perturbed."""
    if isinstance(payload, np.ndarray):
        if payload.ndim == 3 and payload.dtype == np.uint8:
            return "camera"
        if payload.ndim == 1:
            return {3: "gps", 7: "imu"}.get(len(payload), "")
    elif isinstance(payload, Mapping) and "speed" in payload:
        return "speed"
    return ""


def _own(payload: Any) -> Any:
    return payload.copy() if isinstance(payload, np.ndarray) else copy.deepcopy(payload)


class SensedTick(NamedTuple):
    """The perturbed part of one tick: payloads by tag, a copy of what is no image, and what of it is perturbed."""

    cameras: Mapping[str, Any]
    ego: Mapping[str, Any]
    observation: Observation

    @classmethod
    def read(cls, tick: int, payloads: Mapping[str, Any]) -> SensedTick:
        """Read the payloads of a tick. Positions are in metres on the ground, which Mercator stretches."""
        kinds = {tag: "" if tag in DEBUG_CAMERAS else kind_of(item) for tag, item in sorted(payloads.items())}
        cameras = {tag: payloads[tag] for tag, kind in kinds.items() if kind == "camera"}
        ego = {tag: _own(payloads[tag]) for tag, kind in kinds.items() if kind in ("gps", "imu", "speed")}
        x_m = y_m = speed_mps = 0.0
        for payload in ego.values():
            if kind_of(payload) == "gps":
                x_m, y_m = (metres / _stretch(payload) for metres in to_metric(*map(float, payload[:2])))
            elif kind_of(payload) == "speed":
                speed_mps = payload["speed"]
        observation = Observation(
            tick=tick,
            gps=Gps(x_m, y_m, tick),
            compass=Compass(0.0, tick),
            imu=Imu(0.0, 0.0, 0.0, tick),
            speed=Speed(speed_mps, tick),
            cameras={tag: Image(pixels[:, :, :3], tick) for tag, pixels in cameras.items()},
        )
        return cls(cameras, ego, observation)

    @property
    def consumes(self) -> tuple[str, ...]:
        """Name the signals that are there, as agents of the package do: what is not there is 0 in the observation."""
        ego = (signal for payload in self.ego.values() for signal in _SIGNALS[kind_of(payload)])
        return (*(("cameras",) if self.cameras else ()), *ego)

    def written(self, given: Observation, past: Mapping[int, SensedTick]) -> dict[str, Any]:
        """Return the payloads that are not those of this tick; `past` are earlier ticks, and this one."""
        found = {}
        for tag, image in given.cameras.items():
            if tag in self.cameras and image is not self.observation.cameras[tag]:
                found[tag] = self.cameras[tag].copy()
                found[tag][:, :, :3] = image.pixels  # the fourth channel stays
        for tag, payload in self.ego.items():
            kind = kind_of(payload)
            signal = getattr(given, kind)
            if signal is getattr(self.observation, kind):
                continue
            captured = past[signal.tick]
            stale = _own(captured.ego.get(tag, payload))
            if kind == "gps" and signal != captured.observation.gps:
                stretch = _stretch(stale)
                stale[0], stale[1] = to_geodetic(signal.x_m * stretch, signal.y_m * stretch)
            found[tag] = dict(stale, speed=signal.mps) if kind == "speed" else stale
        return found


def _stretch(fix: Any) -> float:
    """Mercator metres of a metre on the ground: 1 at the equator, where nearly all towns are."""
    latitude = float(fix[0])
    return 1.0 if abs(latitude) < 1.0 else 1.0 / cos(math.radians(latitude))
