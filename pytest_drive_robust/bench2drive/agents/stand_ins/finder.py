"""Lets `import carla` and `import leaderboard...` find our stand-ins when no other module has that name."""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import sys
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType, ModuleType

from pytest_drive_robust.bench2drive.agents.stand_ins import foreign_types

_MODULES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "agents": (),
        "agents.navigation": (),
        "agents.navigation.local_planner": ("RoadOption",),
        "carla": ("Location", "Rotation", "Transform", "Vector3D", "VehicleControl"),
        "leaderboard": (),
        "leaderboard.autoagents": (),
        "leaderboard.autoagents.autonomous_agent": ("AutonomousAgent", "Track"),
        "leaderboard.envs": (),
        "leaderboard.envs.sensor_interface": ("SensorConfigurationInvalid", "SensorReceivedNoData"),
        "leaderboard.utils": (),
        "leaderboard.utils.route_manipulation": ("downsample_route",),
        "srunner": (),
        "srunner.scenariomanager": (),
        "srunner.scenariomanager.carla_data_provider": ("CarlaDataProvider",),
        "srunner.scenariomanager.timer": ("GameTime",),
    }
)
"""Modules that agent files import, with the names that they take from each; packages have no names."""


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds and loads the stand-ins; Python asks this finder last."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname not in _MODULES:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, is_package=not _MODULES[fullname])

    def exec_module(self, module: ModuleType) -> None:
        names = _MODULES[module.__name__]
        for name in names:
            setattr(module, name, getattr(foreign_types, name))
        if names:
            module.__getattr__ = _refusal(module.__name__, names)  # type: ignore[method-assign]


def install_stand_ins() -> None:
    """Serve the stand-ins in this process from now on, after every other finder."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())


def _refusal(name: str, names: tuple[str, ...]) -> Callable[[str], object]:
    top = name.partition(".")[0]

    def __getattr__(attribute: str) -> object:  # noqa: N807 - the module's own hook
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        raise AttributeError(
            f"{top!r} is not installed, and our stand-in for {name} has no {attribute!r}: it has "
            f"{', '.join(sorted(names))}. Install {top} or put it on PYTHONPATH."
        )

    return __getattr__
