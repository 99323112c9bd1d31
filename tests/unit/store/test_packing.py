from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from result_factory import make_result, trace_of

from pytest_drive_robust.domain.result import Trace
from pytest_drive_robust.metrics.comfort import comfort
from pytest_drive_robust.store.packing import StoredTrace, pack, unpack, unpack_columns
from pytest_drive_robust.store.record import (
    decode_episode,
    encode_episode,
)

ANY_BITS = arrays(np.uint64, st.tuples(st.integers(0, 40), st.just(len(Trace.COLUMNS))))


@given(bits=ANY_BITS, names=st.lists(st.sampled_from(Trace.COLUMNS), min_size=1, unique=True))
def test_some_columns_are_those_of_the_whole_table_bit_for_bit_and_stride_for_stride(bits, names):
    rows = bits.view(np.float64)
    stored = StoredTrace(packed=pack(rows), ticks=len(rows))
    for got, expected in zip(stored.columns(*names), Trace(rows).columns(*names), strict=True):
        assert got.tobytes() == expected.tobytes()
        assert got.strides == expected.strides


@pytest.mark.parametrize("mode", ["bench2drive", "fixed"])
def test_a_stored_episode_has_the_comfort_of_the_driven_one_and_stays_packed(mode):
    rough = np.random.default_rng(3).normal(0.0, 2.0, 120) * (np.arange(120) >= 80)
    result = make_result(trace=trace_of(120, speed_mps=8.0, forward_mps2=rough, yaw_rate_radps=0.001 * rough))
    stored = decode_episode(encode_episode(result))
    assert comfort(stored, mode=mode) == comfort(result, mode=mode) == 100.0 * 4 / 6
    assert isinstance(stored.trace, StoredTrace)
    assert stored.trace._unpacked is None
    assert stored.trace.rows.tobytes() == result.trace.rows.tobytes()
    assert comfort(replace(stored), mode=mode) == comfort(result, mode=mode)  # by the rows that are there now


@pytest.mark.parametrize("damage", ["cut", "changed", "empty"])
def test_bytes_that_are_no_table_are_told(damage):
    whole = pack(np.arange(33.0).reshape(3, 11))
    data = {"cut": whole[:20], "changed": b"\0" + whole[1:], "empty": b""}[damage]
    with pytest.raises(ValueError, match=r"does not unpack|have \d+ bytes"):
        unpack_columns(data, [2, 5], dtype="<f8", shape=(3, 11))


def test_the_trace_of_a_drive_takes_less_than_its_numbers():
    seconds = np.arange(600) * 0.05
    smooth = trace_of(600, x_m=8.0 * seconds, y_m=np.sin(seconds), yaw_rad=np.cos(seconds), speed_mps=8.0)
    assert len(pack(smooth.rows)) < smooth.rows.nbytes / 4


@given(arrays(np.float32, st.tuples(st.integers(0, 9), st.integers(1, 4))))
def test_tables_of_other_kinds_pack_too(rows):
    assert unpack(pack(rows), dtype="<f4", shape=rows.shape).tobytes() == rows.tobytes()


def test_a_table_of_another_size_is_refused():
    with pytest.raises(ValueError, match="a table of 4 x 2 <f8 has 48 bytes"):
        unpack(pack(np.ones((3, 2))), dtype="<f8", shape=(4, 2))
