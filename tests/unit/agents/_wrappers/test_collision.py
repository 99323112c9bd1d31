from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("drive_robust_agents")

from drive_robust_agents._wrappers.collision import clear_of

CENTRES = np.stack(np.meshgrid(np.arange(-16, 64) + 0.5, np.arange(-16, 16) + 0.5, indexing="ij"), axis=-1)
STRAIGHT = np.stack([np.arange(1, 7) * 3.0, np.zeros(6)], axis=-1)


def world(*cells: tuple[float, float], at: int | None = None) -> np.ndarray:
    maps = np.zeros((5, *CENTRES.shape[:2]))
    for x, y in cells:
        place = (int(x + 16), int(y + 16))
        maps[(slice(None) if at is None else at, *place)] = 1.0
    return maps


def test_a_free_plan_is_given_back_to_the_bit() -> None:
    assert np.array_equal(clear_of(STRAIGHT, world(), CENTRES, from_share=0.5), STRAIGHT)


def test_cells_five_metres_away_change_nothing() -> None:
    assert np.array_equal(clear_of(STRAIGHT, world((9.5, 6.5)), CENTRES, from_share=0.5), STRAIGHT)


def test_unlikely_cells_change_nothing() -> None:
    assert np.array_equal(clear_of(STRAIGHT, 0.4 * world((9.5, 0.5)), CENTRES, from_share=0.5), STRAIGHT)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_plan_gives_way_to_an_obstacle_at_one_side(side: float) -> None:
    cells = [(x + 0.5, side * 1.0 - 0.5 + 0.5 * side) for x in range(2, 20)]
    moved = clear_of(STRAIGHT, world(*cells), CENTRES, from_share=0.5)
    assert (moved[:, 1] * side < -0.3).all()
    assert np.abs(moved - STRAIGHT).max() < 3.0


def test_each_waypoint_looks_at_the_map_of_its_own_time() -> None:
    moved = clear_of(STRAIGHT, world((6.5, 0.5), at=2), CENTRES, from_share=0.5)
    assert not np.array_equal(moved[1], STRAIGHT[1])
    assert np.array_equal(moved[[0, 3, 4, 5]], STRAIGHT[[0, 3, 4, 5]])


def test_the_cost_never_rises() -> None:
    generator = np.random.Generator(np.random.Philox(5))
    for _ in range(20):
        maps = (generator.random((5, *CENTRES.shape[:2])) < 0.05).astype(float)
        moved = clear_of(STRAIGHT, maps, CENTRES, from_share=0.5)
        for t in range(6):
            filled = CENTRES[maps[min(t + 1, 4)] > 0.5]
            filled = filled[np.hypot(*(filled - STRAIGHT[t]).T) < 5.0]

            def cost(point: np.ndarray, cells: np.ndarray = filled, start: np.ndarray = STRAIGHT[t]) -> float:
                bells = np.exp(-0.5 * ((cells - point) ** 2).sum(axis=1))
                return float(((point - start) ** 2).sum() + 5.0 / 2.507 * bells.sum())

            assert cost(moved[t]) <= cost(STRAIGHT[t])
