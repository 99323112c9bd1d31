"""Episodes are the same bits where the C library, BLAS, numpy, OpenCV and numba choose other code than here.

`benchmarks/same_bits.py` looks at every switch by itself, at all routes and at other versions of the libraries.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from llvmlite.binding import get_host_cpu_features
from pretended_machines import OLD, PLAIN, SAME, Driven, drive_on

ORDER = {
    "agents": ["watcher", "random", "reactive", "classical", "expert", "network"],
    "routes": "801,4001",
    "settings": ["3 s burst frame drop and occlusion 0.5 and GPS noise 15 m and speed noise 0.5 and 200 ms latency"],
    "ticks": 120,
}
CAN_CHOOSE = "AVX2"
"""What a processor must have for the libraries to have a choice at all."""
KERNELS = """
import hashlib, json, sys
import numpy as np
from drive_robust_agents._planning.tracks import lane_under
from pytest_drive_robust.arithmetic.compiled import atan, atan2, cos, exp, sin, tan
from pytest_drive_robust.jit.kernels import uncached_entry

@uncached_entry
def digested(values, out):
    for k in range(len(values)):
        x = values[k]
        out[k, 0], out[k, 1], out[k, 2] = sin(x), cos(3.0 * x), atan2(x, 0.3 - x)
        out[k, 3], out[k, 4], out[k, 5] = exp(-abs(x)), atan(abs(x) + 0.1), tan(0.1 * x)
        out[k, 6] = out[k, 0] * out[k, 1] + out[k, 2] * x - out[k, 3] / (1.0 + x * x)

values = (np.arange(20000) - 10000) * 0.0007
out = np.empty((len(values), 7))
digested(values, out)
points = np.column_stack((values, values * 0.5, values, out[:, 1], out[:, 0]))
rows = [lane_under(points, x, 0.3 * x, 0.8, 0.6, 2.0) for x in values[::500].tolist()]
text = digested.inspect_asm(digested.signatures[0])
print(json.dumps([hashlib.blake2b(out.tobytes() + repr(rows).encode()).hexdigest(), "zmm" in text or "ymm" in text]))
"""


@pytest.fixture(scope="module")
def here() -> Driven:
    return drive_on(PLAIN, **ORDER, keep=["network"])


@pytest.fixture(scope="module")
def elsewhere(here: Driven) -> Driven:
    return drive_on(OLD, **ORDER, stored=here.stored)


def unlike(here: Driven, elsewhere: Driven) -> set[str]:
    return {label.split(" | ")[0] for label in here.unlike(elsewhere)}


@pytest.mark.slow
def test_all_but_learned_agents_drive_to_the_same_bits(here: Driven, elsewhere: Driven) -> None:
    assert len(here.digests) == 12
    assert unlike(here, elsewhere) <= {"network"}


@pytest.mark.slow
def test_stored_controls_of_a_network_give_its_trajectory_where_it_drives_another(
    here: Driven, elsewhere: Driven
) -> None:
    again = [value for label, value in elsewhere.digests.items() if label.startswith("stored controls of network")]
    assert again == [SAME, SAME]
    if CAN_CHOOSE in here.libraries["OpenCV code"]:
        assert unlike(here, elsewhere) == {"network"}


@pytest.mark.slow
def test_the_libraries_did_choose_other_code(here: Driven, elsewhere: Driven) -> None:
    if CAN_CHOOSE not in here.libraries["OpenCV code"]:
        pytest.skip(f"this processor has no {CAN_CHOOSE}: libraries have nothing to choose")
    assert set(OLD.shows) <= set(here.changed(elsewhere))


@pytest.mark.slow
@pytest.mark.skipif(not get_host_cpu_features().get("fma"), reason="this processor has no fused multiply-add")
def test_kernels_give_the_same_bits_for_another_processor(tmp_path: Path) -> None:
    """Compiled once for any x86-64, and once for one with fused multiply-add, which must not be used."""
    found = []
    for name in ("x86-64", "x86-64-v3"):
        told = {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path / name)}
        done = subprocess.run(
            [sys.executable, "-c", KERNELS], env=os.environ | told, capture_output=True, text=True, check=True
        )
        found.append(json.loads(done.stdout))
    assert found[0][0] == found[1][0]
    assert [wide for _, wide in found] == [False, True]
