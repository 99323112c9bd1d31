"""Lets `import carla` and `import leaderboard...` find our stand-ins when nothing else of that name is there."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import sys
from collections.abc import Mapping, Sequence
from types import MappingProxyType, ModuleType

__all__ = ["install_stand_ins", "is_stand_in"]

_OURS = "pytest_drive_robust.bench2drive.agents.stand_ins"
_PACKAGE = ""
_MODULES: Mapping[str, str] = MappingProxyType(
    {
        "agents": _PACKAGE,
        "agents.navigation": _PACKAGE,
        "agents.navigation.local_planner": "navigation",
        "carla": "carla_types",
        "leaderboard": _PACKAGE,
        "leaderboard.autoagents": _PACKAGE,
        "leaderboard.autoagents.autonomous_agent": "base_agent",
        "leaderboard.envs": _PACKAGE,
        "leaderboard.envs.sensor_interface": "sensor_errors",
        "leaderboard.utils": _PACKAGE,
        "leaderboard.utils.route_manipulation": "downsampling",
        "srunner": _PACKAGE,
        "srunner.scenariomanager": _PACKAGE,
        "srunner.scenariomanager.carla_data_provider": "data_provider",
        "srunner.scenariomanager.timer": "game_time",
    }
)
"""Names that people import, and the module of ours that has what they want; packages have nothing of their own."""


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """The last to be asked."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        ours = _MODULES.get(fullname)
        if ours is None:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, is_package=ours == _PACKAGE)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType | None:
        return None

    def exec_module(self, module: ModuleType) -> None:
        ours = _MODULES[module.__name__]
        if ours == _PACKAGE:
            return
        source = importlib.import_module(f"{_OURS}.{ours}")
        for name in source.__all__:
            setattr(module, name, getattr(source, name))
        module.__doc__ = source.__doc__
        module.__getattr__ = _refusal(module.__name__, source)  # type: ignore[method-assign]


def install_stand_ins() -> None:
    """Serve the stand-ins in this process from now on, behind every other way to find a module."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())


def is_stand_in(module: ModuleType) -> bool:
    """Return whether a module of one of those names is ours."""
    return isinstance(getattr(module, "__loader__", None), _Finder)


def _refusal(name: str, source: ModuleType):  # type: ignore[no-untyped-def]
    top = name.partition(".")[0]

    def __getattr__(attribute: str) -> object:  # noqa: N807 - the module's own hook
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        raise AttributeError(
            f"{top!r} is not installed, and our stand-in for {name} has no {attribute!r}: it has "
            f"{', '.join(sorted(source.__all__))}. Install {top} or put it on PYTHONPATH."
        )

    return __getattr__
