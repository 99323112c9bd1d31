"""One process and two workers drive the embedded world to the same bits, through the front door."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

SUITE = """
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements('''
    RD under 3 s burst frame drop and 200 ms latency <= 0.99
    RD under GPS noise 5 m and occlusion 0.5 <= 0.99
'''))
def test_it(drive, requirement):
    drive.check(requirement)
"""


def digests(folder: Path, *args: str) -> dict[str, str]:
    target = folder / "run.json"
    command = [sys.executable, "-m", "pytest", "--drive-robust", "-q", "-p", "no:cacheprovider", str(folder)]
    command += [
        "--drive-routes",
        "3801,4301",
        "--drive-stuck-stop",
        "5",
        "--drive-verdict",
        "point",
        "--drive-store",
        "off",  # what one run has driven is not what the next one drives
        "--drive-json",
        str(target),
        *args,
    ]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    episodes = json.loads(target.read_text(encoding="utf-8"))["episodes"]
    return {f"{e['route_id']} {e['setting']}": e["trace_digest"] for e in episodes}


@pytest.mark.slow
def test_one_process_and_two_workers_agree(tmp_path: Path) -> None:
    (tmp_path / "test_suite.py").write_text(SUITE, encoding="utf-8")
    alone = digests(tmp_path)
    assert len(alone) == 6
    assert digests(tmp_path, "-n2") == alone
    assert digests(tmp_path, "-k", "gps") == {name: value for name, value in alone.items() if "burst" not in name}
