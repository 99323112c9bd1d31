from __future__ import annotations

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pytest_drive_robust.perturbations.context import Draws

names = st.text(st.characters(), max_size=12)  # every code point, lone surrogates too
ticks = st.integers(0, 10_000)


@given(st.integers(), names, names, names, st.lists(ticks, min_size=1, max_size=12))
def test_a_number_depends_on_its_names_and_tick_only(
    seed: int, route_id: str, stream: str, sensor: str, order: list[int]
) -> None:
    draws = Draws(seed, route_id, stream)
    draws.uniform("another sensor", 77)
    for tick in order:
        alone = Draws(seed, route_id, stream)
        assert draws.uniform(sensor, tick) == alone.uniform(sensor, tick)
        assert draws.normal(sensor, tick) == alone.normal(sensor, tick)


@given(names, names, names)
def test_names_that_run_together_alike_still_draw_differently(first: str, second: str, third: str) -> None:
    plain = Draws(0, first + second, third).uniform("front", 0)
    moved = Draws(0, first, second + third).uniform("front", 0)
    assert (plain == moved) == (second == "")


@pytest.mark.parametrize(
    "other",
    [
        Draws(1, "route", "stream").uniform("front", 5),
        Draws(0, "route 2", "stream").uniform("front", 5),
        Draws(0, "route", "stream#2").uniform("front", 5),
        Draws(0, "route", "stream").uniform("rear", 5),
        Draws(0, "route", "stream").uniform("front", 6),
    ],
)
def test_each_name_changes_the_numbers(other: tuple[float, ...]) -> None:
    assert Draws(0, "route", "stream").uniform("front", 5) != other


def test_the_numbers_are_the_ones_that_stored_episodes_were_driven_with() -> None:
    # Written out by hand from Philox and blake2b: when this fails, every stored episode is of other noise.
    import hashlib

    key = hashlib.blake2b(digest_size=16, person=b"drive-robust v1")
    for name in (b"7", b"2091", b"gps-noise", b"gps"):
        key.update(len(name).to_bytes(8, "little") + name)
    for tick in (0, 255, 256, 1000):
        words = np.random.Philox(key=int.from_bytes(key.digest(), "little"), counter=tick).random_raw(4)
        expected = tuple(int(word >> np.uint64(11)) / 2**53 for word in words)
        assert Draws(7, "2091", "gps-noise").uniform("gps", tick) == expected
    assert expected == (0.6039263320829106, 0.17279812720201748, 0.22192372789394266, 0.34324207744385127)


def test_another_process_with_another_hash_seed_draws_the_same() -> None:
    code = (
        "import json; from pytest_drive_robust.perturbations.context import Draws;"
        "d = Draws(-3, 'straße \\U0001f697', 's'); print(json.dumps([d.normal('front', t) for t in (900, 0, 3)]))"
    )
    printed = []
    for hash_seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True, text=True)
        printed.append(json.loads(done.stdout))
    here = Draws(-3, "straße \U0001f697", "s")
    assert printed == [[list(here.normal("front", tick)) for tick in (900, 0, 3)]] * 2


def test_no_global_generator_is_touched() -> None:
    import random

    before = random.getstate(), np.random.get_state()[1].tolist()
    Draws(0, "r", "s").normal("front", 3)
    assert (random.getstate(), np.random.get_state()[1].tolist()) == before


def test_uniform_numbers_are_uniform_and_independent() -> None:
    draws = Draws(0, "r", "s")
    rows = np.array([draws.uniform("front", tick) for tick in range(5000)])
    assert rows.min() >= 0.0
    assert rows.max() < 1.0
    for column in rows.T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3
    columns = np.corrcoef(np.column_stack([rows[1:], rows[:-1]]).T)
    assert np.abs(columns - np.eye(8)).max() < 4.0 / math.sqrt(len(rows)) + 0.01


def test_normal_numbers_are_standard_normal_and_independent() -> None:
    draws = Draws(0, "r", "s")
    rows = np.array([draws.normal("gps", tick) for tick in range(5000)])
    for column in rows.T:
        assert stats.kstest(column, "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef(rows.T) - np.eye(4)).max() < 4.0 / math.sqrt(len(rows)) + 0.01


def test_a_normal_number_is_finite_even_for_the_smallest_uniform_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Draws, "uniform", lambda *_: (0.0, 0.0, 1.0 - 2.0**-53, 0.25))
    assert all(map(math.isfinite, Draws(0, "r", "s").normal("gps", 0)))


def test_a_seed_that_is_no_whole_number_is_refused() -> None:
    with pytest.raises(TypeError):
        Draws(1.0, "route", "stream")  # type: ignore[arg-type]
