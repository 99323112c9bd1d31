from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from result_factory import infraction, make_result, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.reception import Reception, Touch
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.store import episodes
from pytest_drive_robust.store.episodes import read_episode, write_episode

FULL = replace(
    make_result(
        "12",
        seed=3,
        setting="GPS noise 5.0 m",
        end=End.BLOCKED,
        completion_pct=100.0 / 3.0,
        infractions=[infraction(InfractionKind.OUTSIDE_LANES, share_pct=12.5), InfractionKind.RED_LIGHT],
        speed_ratios_pct=(0.1 + 0.2, 70.0),
        trace=trace_of(7, x_m=math.pi, speed_mps=float("nan")),
        versions={"embedded": "1", "numba": "0.60"},
    ),
    schedule=(Injection("gps-noise", "gps", 0, 6),),
    inference_s=(0.01, 0.02),
    privileged=True,
    junction_passed=True,
    reception=Reception(("front",), ("cameras", "gps"), 7, (Touch("gps", 7, 0),)),
)


def test_an_episode_comes_back_to_the_bit(tmp_path):
    write_episode(tmp_path / "one.npz", FULL)
    back = read_episode(tmp_path / "one.npz")
    assert back.trace.digest == FULL.trace.digest
    assert replace(back, trace=FULL.trace) == FULL


def test_numbers_of_numpy_become_plain_ones(tmp_path):
    odd = replace(FULL, route_length_m=np.float64(12.0), ticks=np.int64(7), junction_passed=np.bool_(True))
    write_episode(tmp_path / "one.npz", odd)
    back = read_episode(tmp_path / "one.npz")
    assert (type(back.route_length_m), type(back.ticks), type(back.junction_passed)) == (float, int, bool)


def test_nothing_is_left_when_writing_breaks(tmp_path, monkeypatch):
    def full_disk(*_: object, **__: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(episodes.np, "savez", full_disk)
    with pytest.raises(OSError, match="no space left"):
        write_episode(tmp_path / "one.npz", FULL)
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_another_format_is_refused(tmp_path, monkeypatch):
    write_episode(tmp_path / "one.npz", FULL)
    monkeypatch.setattr(episodes, "FORMAT_VERSION", 2)
    with pytest.raises(ValueError, match="has episode format 1, this version reads 2"):
        read_episode(tmp_path / "one.npz")
