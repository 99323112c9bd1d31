from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from result_factory import FULL

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.result import Given, Trace
from pytest_drive_robust.store import record
from pytest_drive_robust.store.record import (
    CorruptRecordError,
    OtherFormatError,
    decode_episode,
    decode_record,
    encode_episode,
)

BYTES = encode_episode(FULL, {"key": "ab", "run": "one"})


def test_what_the_agent_was_given_comes_back_and_may_be_missing():
    back = decode_episode(BYTES)
    assert back.given.rows.tobytes() == FULL.given.rows.tobytes()
    assert back.given.column("gps_x_m").tolist() == FULL.given.rows[:, 1].tolist()
    assert type(pickle.loads(pickle.dumps(back)).given) is Given
    assert replace(back.given, rows=np.zeros((1, 6))).rows.shape == (1, 6)
    assert decode_episode(encode_episode(replace(FULL, given=None))).given is None


def test_equal_results_give_equal_bytes_and_notes_come_back():
    assert encode_episode(decode_episode(BYTES), {"key": "ab", "run": "one"}) == BYTES
    assert decode_record(BYTES).notes == {"key": "ab", "run": "one"}


@given(
    arrays(np.float64, st.tuples(st.integers(0, 30), st.just(len(Trace.COLUMNS)))),
    st.lists(st.floats(), max_size=5),
    st.text(),
)
def test_every_bit_pattern_of_every_number_and_every_name_survives(rows, ratios, name):
    result = replace(
        FULL, trace=Trace(rows), episode=Episode(name, name, name, 1), speed_ratios_pct=tuple(ratios), end_detail=name
    )
    back = decode_episode(encode_episode(result))
    assert back.trace.rows.tobytes() == rows.tobytes()
    assert back.trace.rows.shape == rows.shape
    assert np.array(back.speed_ratios_pct).tobytes() == np.array(ratios, dtype=float).tobytes()
    assert back.episode == result.episode


def test_names_that_are_no_unicode_survive():
    odd = replace(FULL, episode=Episode("a\udcff", "../../x\0", "e" * 10_000, 0))
    assert decode_episode(encode_episode(odd)).episode == odd.episode


def test_a_trace_is_unpacked_when_it_is_read_and_travels_as_an_ordinary_one():
    back = decode_episode(BYTES)
    assert back.trace._unpacked is None
    assert back.trace.digest == FULL.trace.digest
    assert back.trace._unpacked is None
    for copied in (pickle.loads(pickle.dumps(back)), copy.deepcopy(back)):
        assert type(copied.trace) is Trace
        assert copied.trace.rows.tobytes() == FULL.trace.rows.tobytes()
    assert replace(back.trace, rows=np.zeros((1, 11))).rows.shape == (1, 11)


def test_numbers_of_numpy_become_plain_ones():
    odd = replace(FULL, route_length_m=np.float64(12.0), ticks=np.int64(7), junction_passed=np.bool_(True))
    back = decode_episode(encode_episode(odd))
    assert (type(back.route_length_m), type(back.ticks), type(back.junction_passed)) == (float, int, bool)


def test_no_byte_can_change_unseen():
    for place in range(len(BYTES)):
        broken = bytearray(BYTES)
        broken[place] ^= 1 + place % 255
        with pytest.raises(CorruptRecordError):
            decode_episode(bytes(broken))


def test_no_record_is_whole_before_its_last_byte():
    for length in range(len(BYTES)):
        with pytest.raises(CorruptRecordError):
            decode_episode(BYTES[:length])
    with pytest.raises(CorruptRecordError, match="its checksum does not fit"):
        decode_episode(BYTES + b"\0")


@given(st.binary(max_size=200))
def test_bytes_that_are_no_record_are_refused(data):
    with pytest.raises(CorruptRecordError):
        decode_episode(data)


@pytest.mark.parametrize("text", [b"{}", b"[]", b"1", b"nonsense", b'{"tables": [["trace", "<f8", 1, 11, 9]]}'])
def test_a_header_of_something_else_is_refused_even_with_a_checksum(text):
    import hashlib

    body = len(text).to_bytes(4, "little") + text
    whole = b"DREPISO\x01" + hashlib.sha256(body).digest() + body
    with pytest.raises(CorruptRecordError, match="no episode is in it"):
        decode_episode(whole)


def test_a_record_of_another_format_is_refused(monkeypatch):
    monkeypatch.setattr(record, "FORMAT_VERSION", 2)
    with pytest.raises(OtherFormatError, match="it has episode format 1, this version reads 2"):
        decode_episode(BYTES)


@pytest.mark.parametrize("wrong", [{"ticks": "7"}, {"privileged": 1}, {"wall_s": -1.0}, {"versions": {"numpy": 2}}])
def test_a_fact_of_another_kind_is_refused(wrong):
    with pytest.raises(CorruptRecordError, match=r"no episode is in it: .*expected"):
        decode_episode(encode_episode(replace(FULL, **wrong)))
