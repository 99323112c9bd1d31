"""Stands in for `srunner.scenariomanager.carla_data_provider`: where agents find the world that they drive in."""

from __future__ import annotations

from typing import Any, ClassVar

__all__ = ["CarlaDataProvider"]


class CarlaDataProvider:
    """The world of the episode, as the adapter sets it: see `pytest_drive_robust.bench2drive.agents.carla_world`."""

    _world: ClassVar[Any] = None
    _map: ClassVar[Any] = None

    @staticmethod
    def get_world() -> Any:
        """Return what has `get_actors` and `get_map`."""
        return CarlaDataProvider._world

    @staticmethod
    def get_map(world: Any = None) -> Any:
        """Return a `carla.Map` where the carla package is installed."""
        given = CarlaDataProvider._world if world is None else world
        return given.get_map()

    @staticmethod
    def get_hero_actor() -> Any:
        """Return the vehicle that the agent drives."""
        actors = CarlaDataProvider._world.get_actors()
        return next(actor for actor in actors if actor.attributes.get("role_name") == "hero")
