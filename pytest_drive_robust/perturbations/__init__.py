"""Deployment failures, one small class each, and stacks of failures, under which episodes are driven.

Imports point one way, in this order: `severity`, `readings`, `severity_text`; `sentences`; `context`,
`paper_variables`; `base`; a module for each failure, one for both kinds of ego noise; `stack`, `ladder`. A new built-in
failure is a new module and a line in the table below.
"""

from __future__ import annotations

from pytest_drive_robust.perturbations.base import BUILTIN, Perturbation, Setting
from pytest_drive_robust.perturbations.burst_frame_drop import BurstFrameDrop
from pytest_drive_robust.perturbations.context import EpisodeContext
from pytest_drive_robust.perturbations.ego_noise import GpsNoise, SpeedNoise
from pytest_drive_robust.perturbations.frame_blend import FrameBlend
from pytest_drive_robust.perturbations.inference_latency import InferenceLatency
from pytest_drive_robust.perturbations.partial_observation import PartialObservation
from pytest_drive_robust.perturbations.sensor_delay import SensorDelay
from pytest_drive_robust.perturbations.sentence_forms import kebab_name
from pytest_drive_robust.perturbations.stack import RunningStack

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

_TABLE: tuple[type[Perturbation], ...] = (
    BurstFrameDrop,
    PartialObservation,
    GpsNoise,
    SpeedNoise,
    InferenceLatency,
    SensorDelay,
    FrameBlend,
)
BUILTIN.update((kebab_name(cls), cls) for cls in _TABLE)
