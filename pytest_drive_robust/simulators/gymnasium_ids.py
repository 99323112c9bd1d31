"""Importing this module registers our gymnasium environments, as gymnasium 1.x asks for.

::

    import gymnasium
    import pytest_drive_robust.simulators.gymnasium_ids

    env = gymnasium.make("drive_robust/World-v0")
"""

from __future__ import annotations

import gymnasium

__all__: list[str] = []

gymnasium.register(
    id="drive_robust/World-v0", entry_point="pytest_drive_robust.simulators.embedded.environment:WorldEnv"
)
