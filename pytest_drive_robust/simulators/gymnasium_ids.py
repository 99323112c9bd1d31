"""Called by gymnasium at its import through the entry point group `gymnasium.envs`; must stay light."""

from __future__ import annotations

__all__ = ["register_envs"]


def register_envs() -> None:
    """Register `drive_robust/World-v0` (gymnasium adds the namespace of the entry point)."""
    import gymnasium

    gymnasium.register(
        id="World-v0",
        entry_point="pytest_drive_robust.simulators.embedded.environment:WorldEnv",
        nondeterministic=False,
    )
