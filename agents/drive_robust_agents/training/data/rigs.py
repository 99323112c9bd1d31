"""The training inputs of each learned agent: its cameras, and whether it learns from boxes and map vectors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from drive_robust_agents import simlingo, tcp
from drive_robust_agents._wrappers import bev_agent
from pytest_drive_robust import CameraSpec
from pytest_drive_robust.errors import UnknownNameError

__all__ = ["TRAINING_RIGS", "TrainingRig", "agent_rig"]


@dataclass(frozen=True, slots=True)
class TrainingRig:
    """The `cameras` of an agent; `perception` tells whether its labels include boxes and map vectors."""

    cameras: tuple[CameraSpec, ...]
    perception: bool


TRAINING_RIGS: Mapping[str, TrainingRig] = MappingProxyType(
    {
        "simlingo": TrainingRig(simlingo.CAMERAS, perception=False),
        "tcp": TrainingRig(tcp.CAMERAS, perception=False),
        "uniad": TrainingRig(bev_agent.CAMERAS, perception=True),
        "vad": TrainingRig(bev_agent.CAMERAS, perception=True),
    }
)
"""The rig of each agent by its name."""


def agent_rig(agent: str) -> TrainingRig:
    """Return the rig of an agent. Raises `UnknownNameError`."""
    if agent not in TRAINING_RIGS:
        raise UnknownNameError.of("learned agent", agent, TRAINING_RIGS)
    return TRAINING_RIGS[agent]
