"""The injection around the real leaderboard classes: needs a checkout of Bench2Drive and a Python with its client.

Set `PDR_TEST_BENCH2DRIVE` to the checkout and `PDR_TEST_CARLA_PYTHON` to an interpreter that imports `carla` and what
the leaderboard needs (CARLA's `PythonAPI/carla` on `PYTHONPATH`). No server is started.
"""

from __future__ import annotations

import os
import pickle
import subprocess
from pathlib import Path

import numpy as np
import pytest
from official_stream import CAMERAS, command_for, recorded, through_package

from pytest_drive_robust.bench2drive.evaluator import inject
from pytest_drive_robust.bench2drive.evaluator.setup import setting_as_json
from pytest_drive_robust.perturbations import (
    BurstFrameDrop,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    SensorDelay,
    Setting,
    SpeedNoise,
)

ROOT = Path(os.environ.get("PDR_TEST_BENCH2DRIVE", "/nonexistent"))
PROBE = Path(__file__).parents[3] / "helpers" / "official_checkout_probe.py"
PYTHON = os.environ.get("PDR_TEST_CARLA_PYTHON", "")
pytestmark = pytest.mark.skipif(
    not (ROOT / "leaderboard").is_dir() or not PYTHON,
    reason="no checkout of Bench2Drive and no Python with carla given",
)


@pytest.mark.parametrize(
    "setting",
    [
        Setting.CLEAN,
        BurstFrameDrop(1, 0.3) + PartialObservation(0.8) + GpsNoise(15) + SpeedNoise(0.2) + InferenceLatency(200),
        SensorDelay(150) + FrameBlend(4) + PartialObservation(0.5, fill="blur") + InferenceLatency(100, "hold", 5),
    ],
    ids=str,
)
def test_real_leaderboard_classes_are_given_what_the_package_would_give(setting: Setting, tmp_path: Path) -> None:
    stream = [{tag: payload for tag, payload in item.items() if tag != "LIDAR"} for item in recorded(40)]
    for item in stream:
        item["LIDAR"] = np.zeros((0, 4), np.float32)
    inside = through_package(stream, setting, route="2091", seed=3)
    asked = [payloads for payloads in inside.given if payloads is not None]
    job = {
        "stream": stream,
        "route": "2091",
        "environ": {"PDR_SETTING": setting_as_json(setting, seed=3)},
        "commands": [command_for(payloads) for payloads in asked],
    }
    paths = [os.environ.get("PYTHONPATH", ""), str(ROOT / "leaderboard"), str(ROOT / "scenario_runner")]
    ended = subprocess.run(
        [PYTHON, str(PROBE), inject.__file__, str(tmp_path / "out")],
        input=pickle.dumps(job, protocol=4),
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        cwd=ROOT,
        capture_output=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr.decode()[-3000:]
    told = pickle.loads((tmp_path / "out").read_bytes())
    assert told["asked"] == [payloads is not None for payloads in inside.given]
    for got, wanted in zip(told["given"], asked, strict=True):
        assert set(got) == set(wanted)
        for tag, payload in got.items():
            if tag == "SPEED":
                assert payload == wanted[tag]
            else:
                channels = slice(0, 3) if tag in CAMERAS else slice(None)
                assert np.array_equal(payload[..., channels], wanted[tag][..., channels]), tag
    as_carla_keeps_them = [tuple(float(np.float32(value)) for value in applied) for applied in inside.applied]
    assert told["applied"] == as_carla_keeps_them
