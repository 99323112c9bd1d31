"""Stands in for `leaderboard.envs.sensor_interface`: the errors that agents may raise or catch."""

from __future__ import annotations

__all__ = ["SensorConfigurationInvalid", "SensorReceivedNoData"]


class SensorConfigurationInvalid(Exception):  # noqa: N818 - the leaderboard's name
    """An agent asks for sensors that it may not have."""


class SensorReceivedNoData(Exception):  # noqa: N818 - the leaderboard's name
    """A sensor delivers nothing."""
