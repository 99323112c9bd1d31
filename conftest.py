"""For our own tests: pytester, and our plugin where the package runs from this folder without being installed."""

from __future__ import annotations

from importlib import metadata

_PLUGIN = "pytest_drive_robust.plugin"

pytest_plugins = ["pytester"]
if not any(point.value == _PLUGIN for point in metadata.entry_points(group="pytest11")):
    # When it is installed, naming it here as well would register it twice, which pytest refuses.
    pytest_plugins.append(_PLUGIN)
