"""What each pixel of a semantic picture means: CARLA's numbers, so that what was learned there needs no translation."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from pytest_drive_robust.domain.truth import ActorKind

__all__ = ["CLASS_OF_KIND", "KIND_LABELS", "SemanticClass"]


class SemanticClass(IntEnum):
    """The classes that occur, with the tags of CARLA 0.9.14 and later (Cityscapes' classes and a few more).

    Source: CARLA documentation, "Sensors reference", semantic segmentation camera.
    """

    ROAD = 1
    """Driving, parking and biking lanes."""
    SIDEWALK = 2
    """With its kerb."""
    BUILDING = 3
    POLE = 6
    """Of lights and signs."""
    TRAFFIC_LIGHT = 7
    """The housing with its lamps."""
    TRAFFIC_SIGN = 8
    """Stop and warning signs."""
    TERRAIN = 10
    """Grass, and all ground outside of the map."""
    SKY = 11
    PEDESTRIAN = 12
    CAR = 14
    """Cars, vans, emergency vehicles, an open door."""
    TRUCK = 15
    BICYCLE = 19
    """With its rider."""
    DYNAMIC = 21
    """Cones, barriers, containers: what roadworks bring and take."""
    ROAD_LINE = 24
    """Lane lines, stop lines, crossings."""
    GROUND = 25
    """Dirt on the road."""


CLASS_OF_KIND: dict[ActorKind, SemanticClass] = {
    ActorKind.CAR: SemanticClass.CAR,
    ActorKind.VAN: SemanticClass.CAR,
    ActorKind.TRUCK: SemanticClass.TRUCK,
    ActorKind.EMERGENCY: SemanticClass.CAR,
    ActorKind.BICYCLE: SemanticClass.BICYCLE,
    ActorKind.PEDESTRIAN: SemanticClass.PEDESTRIAN,
    ActorKind.CONE: SemanticClass.DYNAMIC,
    ActorKind.BARRIER: SemanticClass.DYNAMIC,
    ActorKind.CONTAINER: SemanticClass.DYNAMIC,
    ActorKind.WARNING_SIGN: SemanticClass.TRAFFIC_SIGN,
    ActorKind.BUILDING: SemanticClass.BUILDING,
    ActorKind.DOOR: SemanticClass.CAR,
    ActorKind.DIRT: SemanticClass.GROUND,
}
"""The class of every kind of actor."""

KIND_LABELS = np.array([CLASS_OF_KIND[kind] for kind in ActorKind], np.int64)
"""`CLASS_OF_KIND` for kernels: the class by number of the kind."""
