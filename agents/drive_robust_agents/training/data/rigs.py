"""What each learned agent sees and needs to learn: its cameras, and whether it learns from boxes and map vectors.

It stands here and not in the agents' own modules because processes that collect data do not import torch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from pytest_drive_robust import CameraSpec, rig
from pytest_drive_robust.errors import UnknownNameError

__all__ = ["TRAINING_RIGS", "TrainingRig", "agent_rig"]


@dataclass(frozen=True, slots=True)
class TrainingRig:
    """The `cameras` of an agent; `perception` says whether boxes and map vectors are among its labels."""

    cameras: tuple[CameraSpec, ...]
    perception: bool


_AROUND = rig("nuscenes", width_px=160, height_px=96)

TRAINING_RIGS: Mapping[str, TrainingRig] = MappingProxyType(
    {
        "simlingo": TrainingRig(rig("simlingo", width_px=256, height_px=128), perception=False),
        "tcp": TrainingRig(rig("tcp", width_px=160, height_px=96), perception=False),
        "uniad": TrainingRig(_AROUND, perception=True),
        "vad": TrainingRig(_AROUND, perception=True),
    }
)
"""The rig of each agent by its name."""


def agent_rig(agent: str) -> TrainingRig:
    """Return the rig of an agent. Raises `UnknownNameError`."""
    if agent not in TRAINING_RIGS:
        raise UnknownNameError.of("learned agent", agent, TRAINING_RIGS)
    return TRAINING_RIGS[agent]
