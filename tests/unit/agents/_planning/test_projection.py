"""Places along a line, and who leads."""

from __future__ import annotations

import pytest
from privileged_scene import street

from drive_robust_agents._planning.projection import project

# --- the forecast ---


def test_a_place_is_found_along_and_beside_a_line() -> None:
    line = street().route
    assert project(line, 0, 200, 42.3, 1.5) == pytest.approx((42.3, 1.5))
