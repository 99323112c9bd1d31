"""highway-env's lanes and road network, of which towns are made, without its environments.

`import highway_env` registers every environment, and with them come pandas and matplotlib: half of what a process pays
before its first episode, for nothing that a drive uses. Here only the files of the road model are loaded, as copies of
our own: whoever imports highway-env later, or has already, gets the whole of it, untouched.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from highway_env.road.lane import AbstractLane, CircularLane, LineType, StraightLane
    from highway_env.road.road import RoadNetwork

__all__ = ["AbstractLane", "CircularLane", "LineType", "RoadNetwork", "StraightLane"]

_PACKAGE = "highway_env"


def _road_model() -> tuple[ModuleType, ModuleType]:
    """Return the modules `road.lane` and `road.road`.

    Raises `ModuleNotFoundError` where highway-env is not installed.
    """
    lane, road = f"{_PACKAGE}.road.lane", f"{_PACKAGE}.road.road"
    if _PACKAGE in sys.modules:
        return importlib.import_module(lane), importlib.import_module(road)
    spec = importlib.util.find_spec(_PACKAGE)
    if spec is None or spec.submodule_search_locations is None:
        raise ModuleNotFoundError(f"No module named {_PACKAGE!r}: pip install highway-env", name=_PACKAGE)
    package = ModuleType(_PACKAGE)
    package.__path__ = list(spec.submodule_search_locations)
    sys.modules[_PACKAGE] = package  # found by the imports below in place of the package that registers
    try:
        return importlib.import_module(lane), importlib.import_module(road)
    finally:
        for name in [name for name in sys.modules if name == _PACKAGE or name.startswith(f"{_PACKAGE}.")]:
            del sys.modules[name]


if not TYPE_CHECKING:
    _lane, _road = _road_model()
    AbstractLane, CircularLane, StraightLane = _lane.AbstractLane, _lane.CircularLane, _lane.StraightLane
    LineType, RoadNetwork = _lane.LineType, _road.RoadNetwork
