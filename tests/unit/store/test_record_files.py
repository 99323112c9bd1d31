from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from result_factory import infraction, make_result, trace_of

from pytest_drive_robust.domain.outcome import End, InfractionKind
from pytest_drive_robust.domain.reception import Reception, Touch
from pytest_drive_robust.domain.result import Given, Injection
from pytest_drive_robust.store import whole_file
from pytest_drive_robust.store.record_files import read_episode, write_episode

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
    given=Given(np.arange(42, dtype=np.float32).reshape(7, 6) / 7),
)


def test_an_episode_comes_back_to_the_bit(tmp_path):
    write_episode(tmp_path / "one.episode", FULL)
    back = read_episode(tmp_path / "one.episode")
    assert back.trace.digest == FULL.trace.digest
    assert back.trace.rows.tobytes() == FULL.trace.rows.tobytes()
    assert replace(back, trace=FULL.trace) == FULL


def test_nothing_is_left_when_writing_breaks(tmp_path, monkeypatch):
    def full_disk(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(whole_file.os, "fsync", full_disk)
    with pytest.raises(OSError, match="no space left"):
        write_episode(tmp_path / "one.episode", FULL)
    assert list(tmp_path.iterdir()) == []
