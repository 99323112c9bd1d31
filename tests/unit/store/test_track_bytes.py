"""Tracks as bytes: whole numbers come back as they were, and there are few bytes."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from result_factory import FULL

from pytest_drive_robust.domain.result import Tracks
from pytest_drive_robust.store.record import decode_episode, encode_episode
from pytest_drive_robust.store.track_bytes import StoredTracks, pack_tracks, unpack_tracks

TABLES = ("actors", "motion", "lights", "plans", "points")
numbers = st.integers(-(2**29), 2**29)


def table(rows: list[list[int]], width: int) -> np.ndarray:
    return np.array(rows, np.int32).reshape(-1, width)


@st.composite
def tracks(draw) -> Tracks:
    counts = draw(st.lists(st.integers(0, 5), max_size=4))
    plans = draw(st.lists(st.tuples(*[st.integers(0, 3)] * 3), max_size=4))
    lines, samples = draw(st.integers(0, 3)), draw(st.integers(0, 5))

    def rows(count: int, width: int) -> list[list[int]]:
        return draw(st.lists(st.lists(numbers, min_size=width, max_size=width), min_size=count, max_size=count))

    return Tracks(
        every_ticks=4,
        actors=table([[*rows(1, 5)[0], count] for count in counts], 6),
        motion=table(rows(sum(counts), 4), 4),
        lights=np.array(rows(samples, lines), np.int32).reshape(samples, lines),
        plans=table([[8 * number, *plan] for number, plan in enumerate(plans)], 4),
        points=table(rows(sum(map(sum, plans)), 2), 2),
    )


def same(one: Tracks, other: Tracks) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in TABLES)


@given(tracks())
def test_every_table_comes_back(given_tracks):
    back = unpack_tracks(pack_tracks(given_tracks))
    assert same(back, given_tracks)
    assert [getattr(back, name).shape for name in TABLES] == [getattr(given_tracks, name).shape for name in TABLES]
    assert back.every_ticks == 4


@pytest.mark.parametrize("data", [b"", b"no tracks", pack_tracks(unpack_tracks(pack_tracks(Tracks(4, *(
    np.zeros((0, width), np.int32) for width in (6, 4, 0, 4, 2))))))[:-4]])  # fmt: skip
def test_other_bytes_are_refused(data):
    with pytest.raises(ValueError, match="no tracks"):
        unpack_tracks(data)


def busy(seconds: float = 40.0, actors: int = 20) -> Tracks:
    """Return tracks of cars that weave, brake and start on their own, with a plan of thirty points in every second."""
    draws = np.random.default_rng(5)
    samples = round(seconds * 5)
    motion = []
    for _ in range(actors):
        speed = np.clip(8.0 + np.cumsum(draws.normal(0.0, 0.4, samples)), 0.0, 20.0)
        yaw = draws.uniform(-3, 3) + np.cumsum(draws.normal(0.0, 0.02, samples))
        place = np.cumsum(np.column_stack((np.cos(yaw), np.sin(yaw))) * speed[:, None] * 0.2, axis=0)
        motion.append(np.column_stack((place * 100.0, yaw * 1000.0, draws.integers(0, 2, samples))))
    heads = [[number, 0, 460, 190, 0, samples] for number in range(actors)]
    plans = [[8 * number, 10, 1, 0] for number in range(round(seconds * 2.5))]
    points = np.cumsum(draws.normal((30.0, 0.0), (2.0, 3.0), (11 * len(plans), 2)), axis=0) % 400
    return Tracks(
        4,
        table(heads, 6),
        np.concatenate(motion).astype(np.int32),
        draws.integers(0, 3, (samples, 8)).astype(np.int32),
        table(plans, 4),
        points.astype(np.int32),
    )


def test_forty_seconds_with_twenty_actors_take_at_most_60_kb():
    assert len(pack_tracks(busy())) <= 60_000


def test_an_episode_keeps_its_tracks_and_may_have_none():
    with_tracks = replace(FULL, tracks=busy(2.0, 3))
    data = encode_episode(with_tracks)
    back = decode_episode(data)
    assert same(back.tracks, with_tracks.tracks)
    assert encode_episode(back) == data
    assert decode_episode(encode_episode(replace(FULL, tracks=None))).tracks is None
    assert back == replace(FULL, trace=back.trace)  # equal episodes are equal with and without them


def test_stored_tracks_travel_between_processes():
    stored = StoredTracks(pack_tracks(busy(1.0, 2)))
    assert same(pickle.loads(pickle.dumps(stored)), stored)
    assert pack_tracks(stored) is stored.packed
