"""The agents know the vehicle that they drive."""

from __future__ import annotations

import pytest

from drive_robust_agents._planning import vehicle
from pytest_drive_robust.simulators.embedded.kernels import ego


@pytest.mark.parametrize("name", vehicle.__all__)
def test_its_numbers_are_those_of_the_embedded_world(name: str) -> None:
    assert getattr(vehicle, name) == getattr(ego, name)
