"""Stands in for `carla`: the few plain types that agents and the leaderboard pass around, metres and degrees.

Axes are CARLA's: x forward (east), y to the right (south), z up; yaw grows clockwise seen from above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass
class Vector3D:
    """Three numbers."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def length(self) -> float:
        """Return the Euclidean norm."""
        return math.sqrt(self.x**2 + self.y**2 + self.z**2)

    def __add__(self, other: Vector3D) -> Vector3D:
        return type(self)(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector3D) -> Vector3D:
        return type(self)(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: float) -> Vector3D:
        return type(self)(self.x * factor, self.y * factor, self.z * factor)

    def __truediv__(self, divisor: float) -> Vector3D:
        return type(self)(self.x / divisor, self.y / divisor, self.z / divisor)


@dataclass
class Location(Vector3D):
    """A place in metres."""

    def distance(self, other: Location) -> float:
        """Return the metres to another place."""
        return (self - other).length()


@dataclass
class Rotation:
    """Degrees: pitch up, yaw clockwise, roll clockwise seen from behind."""

    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0

    def get_forward_vector(self) -> Vector3D:
        """Return where its front looks."""
        pitch, yaw = math.radians(self.pitch), math.radians(self.yaw)
        return Vector3D(math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), math.sin(pitch))

    def get_right_vector(self) -> Vector3D:
        """Return where its right side looks."""
        pitch, yaw, roll = math.radians(self.pitch), math.radians(self.yaw), math.radians(self.roll)
        return Vector3D(
            math.cos(yaw) * math.sin(pitch) * math.sin(roll) - math.sin(yaw) * math.cos(roll),
            math.sin(yaw) * math.sin(pitch) * math.sin(roll) + math.cos(yaw) * math.cos(roll),
            -math.cos(pitch) * math.sin(roll),
        )


@dataclass
class Transform:
    """A place and how something stands there."""

    location: Location = field(default_factory=Location)
    rotation: Rotation = field(default_factory=Rotation)

    def get_forward_vector(self) -> Vector3D:
        """Return where its front looks."""
        return self.rotation.get_forward_vector()

    def get_right_vector(self) -> Vector3D:
        """Return where its right side looks."""
        return self.rotation.get_right_vector()


@dataclass
class VehicleControl:
    """The command for one tick: throttle 0..1, steer -1..1, brake 0..1."""

    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0
