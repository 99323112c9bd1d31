"""Convert the sensor data of an official agent to an observation of the package and back.

Payloads are recognised by their form: uint8 (height, width, 4) is a camera, three numbers are a GNSS fix, seven an IMU,
a mapping with `speed` the speedometer. The leaderboard allows one GNSS, IMU and speedometer each. Lidar, radar and maps
stay as they are, and so does the debug camera `bev`, whose images agents save and do not use.
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
"""The signals of ours that each kind of payload holds."""


def cameras_of(sensors: Iterable[Mapping[str, Any]]) -> list[CameraSpec]:
    """Return the cameras of the agent in order: draws depend on a camera's position in this list, not on its id."""
    return [CameraSpec(str(item["id"])) for item in sensors if str(item["type"]).startswith("sensor.camera.")]


def kind_of(payload: Any) -> str:
    """Return `camera`, `gps`, `imu`, `speed`, or nothing for a payload that is never perturbed."""
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
    """The payloads of one tick that can be perturbed: images by tag, copies of other payloads, and the observation."""

    cameras: Mapping[str, Any]
    ego: Mapping[str, Any]
    observation: Observation

    @classmethod
    def read(cls, tick: int, payloads: Mapping[str, Any]) -> SensedTick:
        """Return the payloads of a tick. Positions are metres on the ground, without the stretch of Mercator."""
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
        """The signals that the agent has, as `consumes` of our agents; a missing signal is 0 in the observation."""
        ego = (signal for payload in self.ego.values() for signal in _SIGNALS[kind_of(payload)])
        return (*(("cameras",) if self.cameras else ()), *ego)

    def written(self, given: Observation, past: Mapping[int, SensedTick]) -> dict[str, Any]:
        """Return the payloads that `given` changes, by tag; `past` has the earlier ticks and this one."""
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
    """Return Mercator metres per metre on the ground: 1 near the equator, where nearly all towns are."""
    latitude = float(fix[0])
    return 1.0 if abs(latitude) < 1.0 else 1.0 / cos(math.radians(latitude))
