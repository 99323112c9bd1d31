"""Our closed forms are the distributions of scipy and mpmath, to the last digits."""

from __future__ import annotations

import mpmath
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
    found = student_t_quantile(freedom, chance)
    assert found == pytest.approx(_root_beside(found, freedom, chance), rel=1e-11)


def _root_beside(value: float, freedom: int, chance: float) -> float:
    """Return the quantile computed with 30 digits: that of scipy 1.15 is farther off than 1e-11."""

    def above_chance(t: mpmath.mpf) -> mpmath.mpf:
        tail = mpmath.betainc(mpmath.mpf(freedom) / 2, 0.5, 0, freedom / (freedom + t * t), regularized=True) / 2
        return (1 - tail if t > 0 else tail) - mpmath.mpf(chance)

    with mpmath.workdps(30):
        ends = mpmath.mpf(value) * (1 - mpmath.mpf("1e-6")), mpmath.mpf(value) * (1 + mpmath.mpf("1e-6"))
        return float(mpmath.findroot(above_chance, ends, solver="anderson"))


@pytest.mark.parametrize("freedom", FREEDOMS)
@pytest.mark.parametrize("value", [-1e7, -40.0, -3.0, -0.1, 0.0, 0.7, 2.5, 1e3])
def test_the_chance_of_student_t(freedom: int, value: float) -> None:
    chance = student_t_chance(freedom, value)
    assert chance == pytest.approx(float(special.stdtr(freedom, value)), abs=1e-14)
    assert 0.0 <= chance <= 1.0
