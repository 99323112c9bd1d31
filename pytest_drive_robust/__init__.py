"""pytest for end-to-end driving policies: closed-loop robustness requirements as failing tests.

Every public name is loaded when it is first used (PEP 562): pytest imports this package in every session of every
environment that has it, so importing it must cost nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_drive_robust.domain.agent import Agent, PlannedPath
    from pytest_drive_robust.domain.camera_rigs import rig, rig_names
    from pytest_drive_robust.domain.control import Control
    from pytest_drive_robust.domain.observation import CameraSpec, Compass, Gps, Image, Imu, Observation, Speed
    from pytest_drive_robust.domain.route import GlobalPlan, PlanPoint, RoadOption
    from pytest_drive_robust.perturbations import (
        BurstFrameDrop,
        EpisodeContext,
        FrameBlend,
        GpsNoise,
        InferenceLatency,
        PartialObservation,
        Perturbation,
        SensorDelay,
        Setting,
        SpeedNoise,
    )
    from pytest_drive_robust.verdict.object_form import requirement
    from pytest_drive_robust.verdict.requirement import Requirement
    from pytest_drive_robust.verdict.sentences import requirements

    __version__: str

__all__ = [
    "Agent",
    "BurstFrameDrop",
    "CameraSpec",
    "Compass",
    "Control",
    "EpisodeContext",
    "FrameBlend",
    "GlobalPlan",
    "Gps",
    "GpsNoise",
    "Image",
    "Imu",
    "InferenceLatency",
    "Observation",
    "PartialObservation",
    "Perturbation",
    "PlanPoint",
    "PlannedPath",
    "Requirement",
    "RoadOption",
    "SensorDelay",
    "Setting",
    "Speed",
    "SpeedNoise",
    "__version__",
    "requirement",
    "requirements",
    "rig",
    "rig_names",
]

_MODULES = {
    "domain.agent": ("Agent", "PlannedPath"),
    "domain.control": ("Control",),
    "domain.observation": ("CameraSpec", "Compass", "Gps", "Image", "Imu", "Observation", "Speed"),
    "domain.route": ("GlobalPlan", "PlanPoint", "RoadOption"),
    "perturbations": (
        "BurstFrameDrop",
        "EpisodeContext",
        "FrameBlend",
        "GpsNoise",
        "InferenceLatency",
        "PartialObservation",
        "Perturbation",
        "SensorDelay",
        "Setting",
        "SpeedNoise",
    ),
    "verdict.requirement": ("Requirement",),
    "verdict.object_form": ("requirement",),
    "verdict.sentences": ("requirements",),
    "domain.camera_rigs": ("rig", "rig_names"),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    if name == "__version__":
        value: object = _version()
    elif name in _HOMES:
        value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value  # asked once
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    """Return the installed version, `"0+unknown"` when the package runs from a folder that was never installed."""
    from importlib import metadata

    try:
        return metadata.version("pytest-drive-robust")
    except metadata.PackageNotFoundError:
        return "0+unknown"
