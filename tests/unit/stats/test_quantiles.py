"""Our closed forms are scipy's distributions, to the last digits."""

from __future__ import annotations

import pytest
from scipy import special

from pytest_drive_robust.stats.quantiles import normal_quantile, student_t_chance, student_t_quantile

FREEDOMS = (1, 2, 3, 4, 9, 10, 23, 43, 219, 1000)
CHANCES = (1e-4, 0.01, 0.05, 0.3, 0.6, 0.9, 0.975, 0.995, 0.9999)


@pytest.mark.parametrize("chance", CHANCES)
def test_the_normal_quantile(chance: float) -> None:
    assert normal_quantile(chance) == pytest.approx(float(special.ndtri(chance)), rel=1e-13)


@pytest.mark.parametrize("freedom", FREEDOMS)
@pytest.mark.parametrize("chance", CHANCES)
def test_the_quantile_of_student_t(freedom: int, chance: float) -> None:
    assert student_t_quantile(freedom, chance) == pytest.approx(float(special.stdtrit(freedom, chance)), rel=1e-11)


@pytest.mark.parametrize("freedom", FREEDOMS)
@pytest.mark.parametrize("value", [-1e7, -40.0, -3.0, -0.1, 0.0, 0.7, 2.5, 1e3])
def test_the_chance_of_student_t(freedom: int, value: float) -> None:
    chance = student_t_chance(freedom, value)
    assert chance == pytest.approx(float(special.stdtr(freedom, value)), abs=1e-14)
    assert 0.0 <= chance <= 1.0
