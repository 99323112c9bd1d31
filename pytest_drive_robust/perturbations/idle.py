"""Why a perturbation changed nothing, in a clause for people: "latency 20 ms is 0 ticks at 20 Hz".

Asked only after whole episodes in which nothing changed. A class of your own is explained in general words, unless you
register a clause for it with `idle_reason.register`.
"""

from __future__ import annotations

from functools import singledispatch

from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.blend import FrameBlend
from pytest_drive_robust.perturbations.camera import BurstFrameDrop, PartialObservation
from pytest_drive_robust.perturbations.compute import InferenceLatency
from pytest_drive_robust.perturbations.delay import SensorDelay
from pytest_drive_robust.perturbations.ego_state import GpsNoise, SpeedNoise
from pytest_drive_robust.perturbations.severity import whole_ticks

__all__ = ["idle_reason"]

_NO_CAMERA = "the agent has no camera"


@singledispatch
def idle_reason(perturbation: Perturbation, cameras: tuple[str, ...], dt_s: float) -> str:
    """Why `perturbation` left everything as it was for an agent with these cameras, ticks being `dt_s` seconds."""
    return "with these severities it leaves every signal and every command as it is"


@idle_reason.register
def _burst(perturbation: BurstFrameDrop, cameras: tuple[str, ...], dt_s: float) -> str:
    if not cameras:
        return _NO_CAMERA
    return f"no burst began (probability {perturbation.probability:g} per camera and tick)"


@idle_reason.register
def _occlusion(perturbation: PartialObservation, cameras: tuple[str, ...], dt_s: float) -> str:
    if not cameras:
        return _NO_CAMERA
    return f"a rectangle of {perturbation.ratio:g} covers nothing that could be seen in {_named(cameras)}"


@idle_reason.register
def _blend(perturbation: FrameBlend, cameras: tuple[str, ...], dt_s: float) -> str:
    if not cameras:
        return _NO_CAMERA
    return f"the mean of {perturbation.frames} frames is the newest one in {_named(cameras)}"


@idle_reason.register
def _latency(perturbation: InferenceLatency, cameras: tuple[str, ...], dt_s: float) -> str:
    if perturbation.mode == "measured":
        return f"every inference took less than one tick of {_ms(dt_s)} ms"
    ticks = whole_ticks((perturbation.ms or 0.0) / 1000.0, dt_s)
    if ticks == 0:
        return f"latency {perturbation.ms:g} ms is 0 ticks at {1.0 / dt_s:g} Hz"
    return f"the agent never gave another command than {ticks} ticks before"


@idle_reason.register
def _delay(perturbation: SensorDelay, cameras: tuple[str, ...], dt_s: float) -> str:
    if perturbation.camera_ms > 0.0 and perturbation.ego_ms == 0.0 and not cameras:
        return _NO_CAMERA
    longest_ms = max(perturbation.camera_ms, perturbation.ego_ms or 0.0)
    return f"a delay of {longest_ms:g} ms is {whole_ticks(longest_ms / 1000.0, dt_s)} ticks at {1.0 / dt_s:g} Hz"


@idle_reason.register
def _gps(perturbation: GpsNoise, cameras: tuple[str, ...], dt_s: float) -> str:
    return f"noise of {perturbation.std_m:g} m moves no position"


@idle_reason.register
def _speed(perturbation: SpeedNoise, cameras: tuple[str, ...], dt_s: float) -> str:
    if perturbation.mean == 1.0 and perturbation.std == 0.0:
        return "a factor of 1 changes no speed"
    return "the vehicle never moved, and a factor of no speed is no speed"


def _named(cameras: tuple[str, ...]) -> str:
    return "the camera " + cameras[0] if len(cameras) == 1 else "the cameras " + ", ".join(cameras)


def _ms(seconds: float) -> str:
    return f"{1000.0 * seconds:g}"
