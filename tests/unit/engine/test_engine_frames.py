"""Messages over a stream arrive whole, in whatever pieces, and nothing else passes for one."""

from __future__ import annotations

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.engine.frames import BrokenStreamError, Frame, FrameReader, read_frame, write_frame

FRAME = Frame(b"R", b"t" * 16, b"what was driven")
FRAMES = st.builds(
    Frame, st.binary(min_size=1, max_size=1), st.binary(min_size=16, max_size=16), st.binary(max_size=300)
)


def as_bytes(*frames: Frame) -> bytes:
    reader, writer = os.pipe()
    try:
        for frame in frames:
            write_frame(writer, frame)
        return os.read(reader, 1 << 16)
    finally:
        os.close(reader)
        os.close(writer)


@given(frames=st.lists(FRAMES, max_size=4), size=st.integers(1, 50))
def test_pieces_of_any_size_make_the_same_messages(frames: list[Frame], size: int) -> None:
    data, reader, found = as_bytes(*frames, FRAME), FrameReader(), []
    for start in range(0, len(data), size):
        found += list(reader.feed(data[start : start + size]))
    assert found == [*frames, FRAME]


def test_a_stream_that_ends_between_messages_is_at_its_end() -> None:
    reader, writer = os.pipe()
    write_frame(writer, FRAME)
    os.close(writer)
    assert read_frame(reader) == FRAME
    assert read_frame(reader) is None
    os.close(reader)


def test_a_stream_that_ends_within_a_message_is_broken() -> None:
    reader, writer = os.pipe()
    os.write(writer, as_bytes(FRAME)[:-1])
    os.close(writer)
    with pytest.raises(BrokenStreamError, match="ended after 14 of 15 bytes"):
        read_frame(reader)
    os.close(reader)


@given(noise=st.binary(min_size=29, max_size=100).filter(lambda data: data[:4] != b"pdr1"))
def test_anything_else_is_no_message(noise: bytes) -> None:
    with pytest.raises(BrokenStreamError, match="a message begins with"):
        list(FrameReader().feed(noise))


def test_a_length_that_no_message_has_is_refused() -> None:
    data = as_bytes(FRAME)[:21] + (1 << 60).to_bytes(8, "little")
    with pytest.raises(BrokenStreamError):
        list(FrameReader().feed(data))
