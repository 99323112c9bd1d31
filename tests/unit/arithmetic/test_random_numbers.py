"""Random numbers made of Philox words: as numpy makes them today, whatever numpy will make of them."""

from __future__ import annotations

import math
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.arithmetic.random_numbers import RandomNumbers

words = st.integers(0, 2**64 - 1)


@given(key=st.tuples(words, words), bounds=st.lists(st.integers(1, 2**32), max_size=30))
def test_numbers_are_those_of_numpy_where_numpy_takes_the_same_words(key: tuple[int, int], bounds: list[int]) -> None:
    ours, theirs = RandomNumbers(key), np.random.Generator(np.random.Philox(key=np.array(key, np.uint64)))
    for bound in bounds:
        assert ours.below(bound) == theirs.integers(bound)
        assert ours.random() == theirs.random()
        assert ours.uniform(-3.25, 17.5) == theirs.uniform(-3.25, 17.5)


def test_the_first_numbers_are_these() -> None:
    numbers = RandomNumbers((7, 0x70776E))
    assert [numbers.random().hex() for _ in range(2)] == ["0x1.72dcc136335f4p-3", "0x1.816401e031976p-1"]


def test_a_key_of_bytes_is_two_words() -> None:
    key = bytes(range(16))
    as_words = int.from_bytes(key[:8], "little"), int.from_bytes(key[8:], "little")
    assert RandomNumbers(key).random() == RandomNumbers(as_words).random()


def test_several_numbers_are_as_many_single_ones() -> None:
    several, single = RandomNumbers((1, 2)), RandomNumbers((1, 2))
    assert several.uniforms(3.0, 4.0, 5).tolist() == [single.uniform(3.0, 4.0) for _ in range(5)]


def test_normal_numbers_are_distributed_normally() -> None:
    drawn = RandomNumbers((5, 6)).normals(2.0, 3.0, 20_001)
    assert len(drawn) == 20_001
    assert float(np.mean(drawn)) == pytest.approx(2.0, abs=0.07)
    assert float(np.std(drawn)) == pytest.approx(3.0, abs=0.05)
    for quantile in (0.01, 0.25, 0.9):
        below = float(np.mean(drawn < statistics.NormalDist(2.0, 3.0).inv_cdf(quantile)))
        assert below == pytest.approx(quantile, abs=4.0 * math.sqrt(quantile * (1.0 - quantile) / 20_001))


def test_a_choice_takes_every_item() -> None:
    numbers = RandomNumbers((5, 6))
    assert {numbers.choice("abc") for _ in range(50)} == set("abc")
