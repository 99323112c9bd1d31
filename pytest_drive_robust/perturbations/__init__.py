"""Deployment failures, one small class each, and the stacks of them that episodes are driven under."""

from __future__ import annotations

from pytest_drive_robust.perturbations.base import EpisodeContext, Perturbation
from pytest_drive_robust.perturbations.blend import FrameBlend
from pytest_drive_robust.perturbations.camera import BurstFrameDrop, PartialObservation
from pytest_drive_robust.perturbations.compute import InferenceLatency
from pytest_drive_robust.perturbations.delay import SensorDelay
from pytest_drive_robust.perturbations.ego_state import GpsNoise, SpeedNoise
from pytest_drive_robust.perturbations.running import RunningStack
from pytest_drive_robust.perturbations.setting import Setting
from pytest_drive_robust.perturbations.template import kebab_name

__all__ = [
    "BUILTIN",
    "BurstFrameDrop",
    "EpisodeContext",
    "FrameBlend",
    "GpsNoise",
    "InferenceLatency",
    "PartialObservation",
    "Perturbation",
    "RunningStack",
    "SensorDelay",
    "Setting",
    "SpeedNoise",
]

BUILTIN: dict[str, type[Perturbation]] = {
    kebab_name(cls): cls
    for cls in (BurstFrameDrop, PartialObservation, GpsNoise, SpeedNoise, InferenceLatency, SensorDelay, FrameBlend)
}
"""Every perturbation that comes with the package, by its name: `"gps-noise"`."""
