"""How the expert sees the others: by the time that went by between two looks, however many ticks that were."""

from __future__ import annotations

import pytest
from privileged_scene import actor, street

from drive_robust_agents._planning.static_scene import StaticScene
from drive_robust_agents._planning.traffic import Traffic
from drive_robust_agents._vehicle.mkz import TICK_S

_ACCELERATION = 6


def looked(speeds_mps: tuple[float, ...], *, every_ticks: int) -> Traffic:
    """See one car drive at these speeds, one look each, so many ticks apart."""
    scenes = [street(actor(60.0, 0.0, speed_mps=speed)) for speed in speeds_mps]
    scene, traffic = StaticScene(scenes[0]), Traffic()
    for truth in scenes:
        traffic.update(truth.state, scene.graph, every_ticks * TICK_S)
    return traffic


@pytest.mark.parametrize("every_ticks", [1, 2, 4, 10])
@pytest.mark.parametrize("mps2", [-3.0, 1.0])
def test_an_acceleration_is_the_same_however_often_it_is_looked_at(every_ticks: int, mps2: float) -> None:
    traffic = looked((9.0, 9.0 + mps2 * every_ticks * TICK_S), every_ticks=every_ticks)
    assert traffic.boxes[0, _ACCELERATION] == pytest.approx(mps2)


@pytest.mark.parametrize("every_ticks", [1, 2, 4, 10])
def test_standing_is_counted_in_seconds(every_ticks: int) -> None:
    traffic = looked((0.0,) * (1 + 20 // every_ticks), every_ticks=every_ticks)
    assert traffic.stood_s[0] == pytest.approx((1 + 20 // every_ticks) * every_ticks * TICK_S)
