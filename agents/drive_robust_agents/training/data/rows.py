"""Convert samples to rows of arrays: labels, and the pictures of the agent's cameras."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drive_robust_agents.training.data.facts import fact_labels
from drive_robust_agents.training.data.labels import Row, motion_labels, way_labels
from drive_robust_agents.training.data.perception import MapLines, box_labels
from drive_robust_agents.training.data.rigs import TrainingRig
from drive_robust_agents.training.data.rollouts import Sample
from pytest_drive_robust import CameraSpec
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.domain.truth import LaneMap, WorldState
from pytest_drive_robust.jit.arrays import Floats
from pytest_drive_robust.simulators.embedded.camera import CameraRig

__all__ = ["RigCameras", "rows"]

SEEN_PX = 4
"""Least number of pixels in some camera of an actor that counts as seen."""


class RigCameras:
    """The cameras of an agent in one episode, whose pictures depend only on the state of the world.

    Kept moments can therefore be drawn later, in any order. `way` is the (n, 4) route of the ground truth.
    """

    def __init__(self, lane_map: LaneMap, route: Route, way: Floats, cameras: Sequence[CameraSpec]) -> None:
        self._rig = CameraRig(lane_map, route.weather, cameras, around=way[:, :2])

    def look(self, state: WorldState) -> dict[str, NDArray[Any]]:
        """Return `cam_<name>` (height, width, 3) uint8 of each camera; the arrays are the caller's."""
        return {f"cam_{name}": pixels.copy() for name, pixels in self._rig.render(state).items()}

    def seen(self, state: WorldState) -> set[int]:
        """Return the numbers (`WorldState.ID`) of the actors that some camera shows."""
        found: set[int] = set()
        for shown in self._rig.actors_seen(state).values():
            numbers = shown.astype(np.int64).ravel()
            counts = np.bincount(numbers[numbers >= 0])
            found.update(int(number) for number in np.flatnonzero(counts >= SEEN_PX))
        return found


def rows(samples: Sequence[Sample], route: Route, agent_rig: TrainingRig, *, tag: int, episode: int) -> Iterator[Row]:
    """Yield one row for each sample, with the arrays that `frames` lists."""
    if not samples:
        return
    truth = samples[0].here.truth
    eyes = RigCameras(truth.lane_map, route, truth.route, agent_rig.cameras)
    lines = MapLines(truth.lane_map) if agent_rig.perception else None
    for sample in samples:
        row: dict[str, Any] = {
            **eyes.look(sample.here.truth.state),
            **way_labels(sample.here),
            **motion_labels(sample.states, sample.controls),
            "facts": fact_labels(sample.here),
        }
        if lines is not None:
            row |= box_labels(sample.states, eyes.seen(sample.here.truth.state)) | lines.labels(sample.here)
        numbers = {"tag": np.int16(tag), "source": np.int8(sample.source)}
        yield row | numbers | {"episode": np.int32(episode), "tick": np.int32(sample.tick)}
