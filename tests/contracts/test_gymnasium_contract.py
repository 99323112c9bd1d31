"""The public contract check on worlds that gymnasium environments move."""

from __future__ import annotations

import pytest

from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.testing import check_simulator


@pytest.mark.parametrize("name", ["gymnasium:roundabout-v0", "gymnasium:intersection-v1", "gymnasium:merge-generic-v1"])
def test_a_gymnasium_world_keeps_the_contract(name):
    registry = Registry()
    route = registry.simulator(name).routes(())[4]  # type: ignore[attr-defined]
    report = check_simulator(lambda options: registry.simulator(name, options), route=route, seed=1)
    assert report.ok, str(report)
